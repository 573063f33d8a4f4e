"""Plan of safe motions that show the properties of a drive: a schedule of `preset` commands for the control unit.

Each axis moves alone about the middle of its travel: constant rates, reversals, pulses, and a turn both ways if the
travel allows a turn. docs/calibrate/receiver-drive-gt.md states the purpose and the limits of each motion.
"""
import dataclasses
import math

from acu_tracker.params import AcuParameters
from acu_tracker.servo import travel
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Radians, RadiansPerSecond, RadiansPerSecond2, Seconds

MAX_RATE_SHARE, MARGIN_SHARE = 0.5, 0.05  # shares of the shaper's rate and of the travel [-]
SLOW_RATES_RAD_S = (0.5e-3, 1e-3, 2e-3, 4e-3, 8e-3, 0.02, 0.05, 0.15, 0.4)  # rates below the largest one [rad/s]
RATE_TIME_S, SLOWEST_TRAVEL_RAD = 3.0, 4e-3
"""Time at each rate [s], and smallest angle that it covers [rad], so that the bristles of the friction slide."""
REVERSAL_COUNT, REVERSAL_TIME_S = 8, 0.8  # number of reversals and time between two of them [s]
PULSE_COUNT, PULSE_INTERVAL_S, PULSE_TIME_S = 31, 0.35, 0.06
"""Number of pulses, time between two of them, and time of the motion of a pulse [s]."""
PULSE_LEVELS = (0, 1, 1, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 1, 0, 0, 0, 1, 1, 1, 1, 1, 0)
"""Levels of the pulses: the sequence of a shift register of 5 bits, whose spectrum is flat."""
PULSES_TIME_S = 1.0 + PULSE_COUNT * PULSE_INTERVAL_S
"""Time of the constant rate under the pulses, with the part before the first pulse [s]."""
PULSE_RATES_RAD_S = (0.1, 0.05)  # constant rates of azimuth and elevation under the pulses [rad/s]
TURN_RAD, TURN_RATE_RAD_S = 1.02 * 2.0 * math.pi, 0.5
"""Angle of a turn with an overlap [rad] and its largest rate [rad/s]."""
SETTLING_TIME_S = 0.6  # time after a motion before the next [s]
MIN_TRAVEL_RAD = math.radians(5.0)  # smallest travel of an axis, less its margins [rad]
LONG_TIME_S, MAX_TIME_S = 3600.0, 86400.0  # duration that is remarked, and longest duration of a run [s]


@dataclasses.dataclass(frozen=True)
class MotionPlan:
    """Motions of a calibration of the drive."""
    commands: str           # text for the parameter acu.commands
    start: tuple[Radians, ...]      # azimuth, elevation
    duration: Seconds       # of the run
    limits: tuple[str, ...]     # lines that state the limits of the motions, and the reason of a long duration


class _Schedule:
    """Commands of the mode preset for one axis after another."""

    def __init__(self, acu: AcuParameters) -> None:
        self.acu, self.t = acu, 2.0
        self.parts: list[str] = []
        self.ranges = [_range(acu, name) for name in AXES]
        self.angles = [0.5 * (low + high) for low, high in self.ranges]
        self.start = tuple(self.angles)

    def command(self, i: int, angle: Radians, wait: Seconds, rate: RadiansPerSecond = 0.0,
                moves: Seconds = 0.0) -> None:
        """Command axis i to an angle, move from there at a rate for the time `moves`, and wait."""
        self.angles[i] = angle
        text = f'{self.t:.3f} preset ' + ' '.join(f'{name}={at:.6f}' for name, at in zip(AXES, self.angles))
        if rate:
            text += f' {AXES[i]}_rate={rate:.6g} moves={moves:.3f}'
        self.parts.append(text)
        self.angles[i] += rate * moves
        self.t += moves + wait

    def slew(self, i: int, angle: Radians) -> None:
        """Move axis i to an angle and wait for its arrival."""
        shaper = (self.acu.azimuth, self.acu.elevation)[i].shaper
        way, rate = abs(angle - self.angles[i]), MAX_RATE_SHARE * shaper.rate
        if way > 0.0:
            time = way / rate
            self.command(i, self.angles[i], SETTLING_TIME_S + rate / shaper.acceleration,
                         math.copysign(rate, angle - self.angles[i]), time)
            self.angles[i] = angle


def _range(acu: AcuParameters, name: str) -> tuple[Radians, Radians]:
    """Return the range of the motions of an axis. Raises ValueError for a too short travel."""
    limits, cause = getattr(acu, name).limits, f'acu.{name}.limits'
    low, high = limits.low, limits.high
    _, heights = travel.floor_points(acu.floor)
    if name == 'elevation' and heights and max(heights) + travel.FLOOR_CLEARANCE_RAD > low:
        low, cause = max(heights) + travel.FLOOR_CLEARANCE_RAD, 'acu.floor'
    margin = MARGIN_SHARE * (high - low)
    if high - low - 2.0 * margin < MIN_TRAVEL_RAD:
        raise ValueError(f'{cause}: leaves {math.degrees(max(high - low - 2.0 * margin, 0.0)):.1f} deg of {name} for '
                         f'the motions, must be at least {math.degrees(MIN_TRAVEL_RAD):g} deg')
    return low + margin, high - margin


def time_text(seconds: Seconds) -> str:
    """Return a duration as '260 s', or as '10 h 44 min' from LONG_TIME_S on."""
    if seconds < LONG_TIME_S:
        return f'{seconds:g} s'
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f'{hours} h {minutes} min'


def plan(acu: AcuParameters) -> MotionPlan:
    """Return the plan for the limits of a control unit. Raises ValueError for a short travel or too long motions."""
    schedule, limits, times = _Schedule(acu), [], {}
    for i, (name, axis) in enumerate(zip(AXES, (acu.azimuth, acu.elevation))):
        (low, high), begin = schedule.ranges[i], schedule.t
        middle, largest = 0.5 * (low + high), MAX_RATE_SHARE * axis.shaper.rate
        _rates(schedule, i, middle, 0.6 * (high - low), largest, axis.shaper.acceleration)
        _reversals(schedule, i, middle, 0.5 * largest)
        _pulses(schedule, i, middle, min(PULSE_RATES_RAD_S[i], largest, 0.9 * (high - low) / PULSES_TIME_S),
                axis.shaper.acceleration)
        if high - low > TURN_RAD:
            rate = min(TURN_RATE_RAD_S, largest)
            schedule.slew(i, middle - 0.5 * TURN_RAD)
            for sign in (1.0, -1.0):
                schedule.command(i, schedule.angles[i], 1.0, sign * rate, TURN_RAD / rate)
        schedule.slew(i, middle)
        limits.append(f'{name}: {math.degrees(low):.1f} to {math.degrees(high):.1f} deg, at most {largest:.3g} rad/s '
                      f'and {axis.shaper.acceleration:.3g} rad/s2')
        times[name] = schedule.t - begin
    if schedule.t > LONG_TIME_S:
        slow = max(times, key=lambda name: times[name])
        reason = f'acu.{slow}.shaper.rate = {getattr(acu, slow).shaper.rate:g} rad/s: {slow} needs '
        if schedule.t > MAX_TIME_S:
            raise ValueError(f'{reason}{time_text(times[slow])} for the motions; a run has at most '
                             f'{time_text(MAX_TIME_S)}')
        limits.append(f'{reason}{time_text(times[slow])} of it; a larger rate shortens the motions')
    return MotionPlan('; '.join(schedule.parts), schedule.start, math.ceil(schedule.t + 1.0), tuple(limits))


def _rates(schedule: _Schedule, i: int, middle: Radians, travel: Radians, largest: RadiansPerSecond,
           acceleration: RadiansPerSecond2) -> None:
    for rate in (*(rate for rate in SLOW_RATES_RAD_S if rate < 0.8 * largest), largest):
        time = min(max(RATE_TIME_S, SLOWEST_TRAVEL_RAD / rate), travel / rate)
        schedule.slew(i, middle - 0.5 * rate * time)
        for sign in (1.0, -1.0):
            schedule.command(i, schedule.angles[i], SETTLING_TIME_S + rate / acceleration, sign * rate, time)


def _reversals(schedule: _Schedule, i: int, middle: Radians, rate: RadiansPerSecond) -> None:
    """Add reversals of a rate about the middle, without a stop between them."""
    schedule.slew(i, middle - 0.5 * rate * REVERSAL_TIME_S)
    for k in range(REVERSAL_COUNT):
        last = k == REVERSAL_COUNT - 1
        schedule.command(i, schedule.angles[i], SETTLING_TIME_S if last else 0.0, rate if k % 2 == 0 else -rate,
                         REVERSAL_TIME_S)


def _pulses(schedule: _Schedule, i: int, middle: Radians, rate: RadiansPerSecond,
            acceleration: RadiansPerSecond2) -> None:
    # A step of this size keeps the sign of the rate, and takes about PULSE_TIME_S.
    step = min(acceleration * (0.5 * PULSE_TIME_S)**2, 0.25 * rate * rate / acceleration)
    begin = middle - 0.5 * rate * PULSES_TIME_S
    schedule.slew(i, begin)
    schedule.command(i, begin, 0.0, rate, 1.0)
    level = 0.0
    for k in range(PULSE_COUNT):
        level = step * PULSE_LEVELS[k % len(PULSE_LEVELS)]
        at = begin + rate * (1.0 + k * PULSE_INTERVAL_S)
        last = k == PULSE_COUNT - 1
        schedule.command(i, at + level, SETTLING_TIME_S if last else 0.0, rate, PULSE_INTERVAL_S)
