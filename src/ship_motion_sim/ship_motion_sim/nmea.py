"""Attitude as NMEA 0183 sentences for third-party equipment: HEHDT (heading), PASHR and PRDID (attitude), HEROT (rate
of turn).

Signs of PASHR: roll positive with the port side up, pitch positive with the bow up, heave positive upwards. Because a
positive pitch in FLU has the bow down, its sign changes.
"""
import math

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Degrees, Meters, Nanoseconds, Radians, RadiansPerSecond


def sentence(body: str) -> bytes:
    """Return the sentence of a body, between $ and checksum, with CR LF."""
    checksum = 0
    for byte in body.encode('ascii'):
        checksum ^= byte
    return f'${body}*{checksum:02X}\r\n'.encode('ascii')


def time_of_day(stamp: Nanoseconds) -> str:
    """Return hhmmss.sss of a stamp. The integers avoid rounding: 0.57 s as a float is 569.99 ms."""
    seconds, milliseconds = divmod(stamp // 1_000_000 % (1000 * SECONDS_PER_DAY), 1000)
    return f'{seconds // 3600:02d}{seconds // 60 % 60:02d}{seconds % 60:02d}.{milliseconds:03d}'


def heading(yaw: Radians) -> Degrees:
    """Return the heading, 0 to 359.999, of a REP 103 yaw, rounded to three decimal places."""
    return round(math.degrees(0.5 * math.pi - yaw), 3) % 360.0


def attitude(stamp: Nanoseconds, roll: Radians, pitch: Radians, yaw: Radians, heave: Meters) -> bytes:
    """Return HEHDT and PASHR in one datagram at a stamp, for roll, pitch, yaw (REP 103: FLU in ENU)."""
    psi = heading(yaw)
    # PASHR ends with the accuracies of roll, pitch and heading (0.000 deg: exact), GNSS quality 1 and INS status 0.
    return sentence(f'HEHDT,{psi:.3f},T') + sentence(
        f'PASHR,{time_of_day(stamp)},{psi:.3f},T,{math.degrees(roll):+.3f},{-math.degrees(pitch):+.3f},{heave:+.3f},'
        '0.000,0.000,0.000,1,0')


def angles(roll: Radians, pitch: Radians, yaw: Radians) -> bytes:
    """Return PRDID for roll, pitch, yaw (REP 103: FLU in ENU). It has no time."""
    return sentence(f'PRDID,{-math.degrees(pitch):+.3f},{math.degrees(roll):+.3f},{heading(yaw):.3f}')


def turn(yaw_rate: RadiansPerSecond) -> bytes:
    """Return HEROT of a yaw rate (REP 103, to port positive). ROT is in deg/min, to starboard positive."""
    return sentence(f'HEROT,{-60.0 * math.degrees(yaw_rate):.1f},A')
