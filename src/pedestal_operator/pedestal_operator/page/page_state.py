"""Content of the page of the operator: the sections of the state, of an antenna or of a recording. No ROS here."""
import abc
import json
import math
from collections.abc import Iterable, Mapping

from pedestal_common.geometry import pointing_report
from pedestal_common.geometry.geodesy import STATION_NAMES, GivenStation
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.topics import PASS_STATES
from pedestal_common.parameters import NOT_GIVEN
from pedestal_common.quantities import Degrees, Json, Seconds
from pedestal_operator import state
from pedestal_operator.antenna import Antenna
from pedestal_operator.page import page_sky

MOTOR_STATES_TOPIC = 'adu/motor_states'
ATTITUDE_TOPIC = 'ship/imu/data'
EXTRA_NUMBER_TOPICS = (MOTOR_STATES_TOPIC, ATTITUDE_TOPIC)

NIGHT_TOPIC = 'station/night'
TEXT_TOPIC_BY_NAME = {'keyhole': 'acu/keyhole', 'blockage': 'acu/blockage'}  # {name on the page: topic of the text}

ELEMENT_PARAMETERS = 'line_1', 'line_2', 'omm'

SHOWN_PARAMETERS = {'acu': ('graph.start', 'tracker.receiver.beamwidth', 'blockage', 'floor', 'prediction.start_time',
                            *(f'prediction.station.{name}' for name in STATION_NAMES),
                            *(f'{axis}.limits.{end}' for axis in topics.AXES for end in ('low', 'high')),
                            *(f'{axis}.stow' for axis in topics.AXES)),
                    'tracking_receiver': ('target.kind', *(f'receiver.{name}' for name in (
                                              'acquire_level_dbhz', 'lose_level_dbhz', 'horizon_mask')),
                                          *(f'target.leo_pass.{name}' for name in ELEMENT_PARAMETERS))}

CHART_SPAN_S, CHART_PERIOD_S = 600.0, 0.5  # time span of the strip charts, and time between two points [s]

HISTORY_COLUMNS = ('t', 'cross_elevation', 'elevation', 'azimuth_error', 'elevation_error', 'azimuth_rate',
                   'elevation_rate', *topics.MOTOR_NAMES, 'level')


class PageAntenna(Antenna):
    """What the page needs of an antenna."""
    configuration: dict[str, Json]      # {name of a parameter of SHOWN_PARAMETERS: value}
    path: page_sky.Path | None          # program track

    @property
    @abc.abstractmethod
    def now(self) -> Seconds:
        """Time in UTC."""


def _deck(antenna: PageAntenna) -> page_sky.Deck:
    return page_sky.Deck(antenna.numbers[ATTITUDE_TOPIC][:4] if antenna.present(ATTITUDE_TOPIC) else None)


def now(antenna: PageAntenna) -> dict[str, Json]:
    """Return the present numbers: angles and errors [deg], rates [deg/s], level [dB-Hz], torques of the motors [Nm].
    `axes` are deck angles of the beam on the sky, with the encoder angles; `beam` are its earth angles."""
    actual, commanded = antenna.directions('joint_states'), antenna.directions('acu/reference')
    torques = []
    if antenna.present(MOTOR_STATES_TOPIC):
        torques = [round(float(torque), 3)
                   for torque in antenna.numbers[MOTOR_STATES_TOPIC][-len(topics.MOTOR_NAMES):]]
    return {'t': antenna.now, 'mode': antenna.texts.get('acu/mode', ''),
            'axes': [{'actual': a, 'commanded': c, 'error': c - a, 'encoder': encoder, 'rate': rate}
                     for a, c, encoder, rate in zip(actual, commanded, antenna.encoder_angles('joint_states'),
                                                    antenna.rates())],
            'receiver': list(state.receiver(antenna)), 'torques': torques,
            'beam': _deck(antenna).seen(*actual)}


def history_row(frame: Mapping[str, Json]) -> list[float]:
    """Return a row of HISTORY_COLUMNS from the numbers of `now`."""
    azimuth, elevation = frame['axes']
    x, y, level = frame['receiver']
    torques = [*frame['torques'], *(math.nan,) * len(topics.MOTOR_NAMES)][:len(topics.MOTOR_NAMES)]
    row = (x, y, azimuth['error'], elevation['error'], azimuth['rate'], elevation['rate'], *torques, level)
    return [round(frame['t'], 2), *(round(float(value), 5) for value in row)]


def status_section(antenna: PageAntenna) -> dict[str, Json]:
    """Return the state of the antenna for the header, the axes and the buttons. `refused` has {command: reason} for a
    client that has control (`holder`), for another, and for another supervisor."""
    acu, header = antenna.diagnostics_of('acu'), state.header(antenna)
    texts = {name: antenna.texts.get(topic, '') if acu else '' for name, topic in TEXT_TOPIC_BY_NAME.items()}
    return {'present': bool(acu), **texts, 'mode': (antenna.texts.get('acu/mode') or acu['mode']) if acu else '',
            **{key: acu.get(key, '') for key in ('control', 'requester', 'fallback', 'locked')},
            'header': {name: shown._asdict() for name, shown in header.items()},
            'axes': [shown._asdict() for shown in state.axis_states(antenna)],
            'model': antenna.pointing_model.title if antenna.pointing_model else '',
            'steps': acu.get('clock_steps', ''), 'offset_ms': acu.get('offset joint_states_ms', ''),
            'first_alarm': first_alarm(antenna),
            'refused': {'holder': state.refusals(antenna, True), 'other': state.refusals(antenna, False),
                        'supervisor': state.refusals(antenna, False, may_take=True)}}


def alarms(antenna: PageAntenna) -> list[dict[str, Json]]:
    """Return the list of acu/alarms in its order, with times in UTC [s]."""
    return [_dated(antenna, state.alarm(status)) for status in antenna.alarms]


def first_alarm(antenna: PageAntenna) -> dict[str, Json] | None:
    """Return state.first_alarm with its time in UTC [s]."""
    first = state.first_alarm(antenna)
    return first and _dated(antenna, first)


def _dated(antenna: PageAntenna, alarm: Mapping[str, Json]) -> dict[str, Json]:
    return {**alarm, 'raised': epoch(antenna) + alarm['raised_s']}


def epoch(antenna: PageAntenna) -> Seconds:
    """Return the UTC at which the time of the graph is 0 [s]: graph.start, or the start of the day."""
    return antenna.configuration.get('graph.start', 0) * 1e-9 or antenna.now // 86400.0 * 86400.0


def station(antenna: PageAntenna) -> GivenStation:
    """Return the position of an antenna, as far as it is known."""
    return GivenStation(*(antenna.configuration.get(f'prediction.station.{name}', NOT_GIVEN)
                          for name in STATION_NAMES))


def night(text: str) -> dict[str, Json] | None:
    """Return the night of a station from its text: what it does now, and its passes with times in UTC [s]. None for a
    text of another form."""
    try:
        given = json.loads(text)
        found = [{'case': str(each['case']), 'begin': float(each['begin']), 'end': float(each['end']),
                  'highest': float(each['max_elevation_deg']), 'state': PASS_STATES[PASS_STATES.index(each['state'])],
                  'text': str(each['text'])} for each in given['passes']]
        return {'now': str(given['now']), 'passes': found}
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def fixed(antenna: PageAntenna) -> dict[str, Json]:
    """Return the constants of a run: beamwidth and limits [deg], thresholds of the level [dB-Hz], axes of charts."""
    p = antenna.configuration

    def degrees(name: str) -> Degrees:
        return math.degrees(p.get(name, math.nan))
    return {'beamwidth': degrees('tracker.receiver.beamwidth'), 'history': HISTORY_COLUMNS, 'span': CHART_SPAN_S,
            'modes': state.BUTTON_MODES,
            'drive': [{'name': row.name.replace('_', ' '), 'verb': row.service, 'doc': row.doc}
                      for row in nodes.DRIVE_REQUESTS],
            'limits': [[degrees(f'{axis}.limits.{end}') for end in ('low', 'high')] for axis in topics.AXES],
            'stow': [degrees(f'{axis}.stow') for axis in topics.AXES],
            'detect': p.get('receiver.acquire_level_dbhz'), 'loss': p.get('receiver.lose_level_dbhz')}


def sky(antenna: PageAntenna, coming: Iterable[Mapping[str, float]]) -> dict[str, Json]:
    """Return the content of the sky plot in earth angles [deg]: path, hidden sectors, lines, sun and passes.

    `floor`, `top`: lines of the lowest and highest elevation in reach; `hole`: time of the keyhole, UTC [s];
    `station`: position of the antenna, '' while it is unknown; `residuals`: those of the pointing model, azimuth and
    elevation on the deck, cross-elevation, elevation [deg]. coming: passes after the track.
    """
    deck, p, acu = _deck(antenna), antenna.configuration, antenna.diagnostics_of('acu')
    begin = epoch(antenna)
    hole = [begin + float(acu[key]) for key in ('keyhole_begins_s', 'keyhole_ends_s') if key in acu]
    floor = page_sky.numbers(p.get('floor', ''))
    low, high = (math.degrees(p.get(f'elevation.limits.{end}', math.nan)) for end in ('low', 'high'))
    sun = [float(acu[key]) for axis in topics.AXES if (key := f'sun_{axis}_deg') in acu]
    last = antenna.path.times[-1] if antenna.path else -math.inf
    known = f'prediction.station.{STATION_NAMES[0]}' in p
    return {'station': station(antenna).text if known else '',
            'path': page_sky.thinned(antenna.path), 'hole': hole, 'sun': sun,
            'coming': [each for each in coming if each['aos'] > last],
            'passes': page_sky.passage(antenna.path, acu.get('keyhole_loss_s', '')),
            'sectors': [deck.sector(*row) for row in page_sky.numbers(p.get('blockage', ''))],
            'floor': deck.line([*floor, [floor[0][0] + 360.0, floor[0][1]]]) if floor else
                     deck.line([[0.0, low], [360.0, low]]) if low > 0.0 else [],
            'top': deck.line([[0.0, high], [360.0, high]]) if high < 90.0 else [],
            'residuals': (pointing_report.residual_rows(antenna.pointing_model.residuals) if antenna.pointing_model
                          else []),
            'bow': deck.seen(0.0, 0.0) if antenna.present(ATTITUDE_TOPIC) else []}
