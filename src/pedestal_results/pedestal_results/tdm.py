"""`pedestal export --format tdm`: write the measured directions of the target as a CCSDS Tracking Data Message.

A program for orbit determination reads this message. The format is CCSDS 503.0-B-2 in keyword = value notation. Only
steps in autotrack with a locked receiver are written. On a ship, the attitude of the INS rotates the deck angles to
earth angles. Nothing is corrected for refraction. Times are UTC.
"""
import datetime
import json
import pathlib
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pedestal_common.geometry import orbit
from pedestal_common.graph import nodes
from pedestal_common.quantities import Floats, Hertz, Pairs, Stamps, Texts
from pedestal_recording import bag as bags
from pedestal_recording import columns
from pedestal_recording import recording as recordings
from pedestal_recording.export import atomic_file
from pedestal_results import directions
from tracking_receiver_sim.tracks import instant

RATE_LIMITS_HZ = 1e-3, 1000.0  # smallest and largest allowed rate of records [Hz]
SEGMENT_STEPS = 10_000  # largest number of steps in a segment of the message, all of which are in memory at once
DEFAULT_STATION_NAME = 'PEDESTAL'  # default name of the station

PARTICIPANT_PATTERN = re.compile(r'[ -~]{1,80}')
"""Pattern of the name of a participant (station or target): printable ASCII characters."""

TLE_DESIGNATOR_PATTERN = re.compile(r'(\d\d)(\d{3})([A-Z]{1,3}) *')
"""Pattern of the international designator in a TLE (two-line elements): year, number of the launch, piece."""

TLE_DESIGNATOR_COLUMNS = slice(9, 17)  # columns of the international designator in line 1 of a TLE

TOPIC_COLUMNS = {'joint_states': ('azimuth.position', 'elevation.position'),
                 'tracking_receiver/angle_error': ('x', 'y', 'z'),
                 'ship/imu/data': tuple(f'orientation.{axis}' for axis in 'xyzw'),
                 'tracking_receiver/range': ('range',)}
"""{topic: columns of its table that a record needs}."""


class _Segment(NamedTuple):
    """Exported steps of a run, which stand in one segment of the message."""
    times: Texts        # of the UTC
    angles: Pairs       # azimuth and elevation [deg]
    distance: Floats    # range [km], NaN if not measured
    cn0: Floats         # [dB-Hz]


def export(path: str | pathlib.Path, created: datetime.datetime, output: str | pathlib.Path | None = None,
           rate: Hertz = 10.0, participants: Sequence[str] = (),
           overwrite: bool = False) -> Iterator[tuple[pathlib.Path, int]]:
    """Write the tracking data of the bag at a path. Yield (file, number of records) for each beam.

    created       creation date that the message states, in UTC
    output        file with the suffix .tdm, or folder; by default the folder `export` in the bag
    rate          largest number of records per second
    participants  names of the station and of the target; by default DEFAULT_STATION_NAME, and the international
                  designator of a satellite

    Raises bag.BagError and ValueError, or FileExistsError before anything is written.
    """
    if not RATE_LIMITS_HZ[0] <= rate <= RATE_LIMITS_HZ[1]:
        raise ValueError(f'--rate {rate:g}: must be {RATE_LIMITS_HZ[0]:g} to {RATE_LIMITS_HZ[1]:g} records a second')
    for name in participants:
        if not PARTICIPANT_PATTERN.fullmatch(name):
            raise ValueError(f'--participants {name!r:.60}: must be 1 to 80 ASCII characters')
    bag = bags.read(path)
    for file, view in _files(bag, output, overwrite).items():
        tracks, models = _Tracks(view, rate), directions.titles(view)
        file.parent.mkdir(parents=True, exist_ok=True)
        records = 0
        with atomic_file(file) as part, open(part, 'w', encoding='ascii', newline='') as stream:
            stream.write(_header(view, created))
            for segment in tracks.segments():
                records += len(segment.times)
                stream.write(_segment(segment, _participants(view, participants), models))
            if not records:
                raise bags.BagError(f'{path}: nothing to export: no step is in autotrack with a locked receiver')
        yield file, records


def _files(bag: bags.Bag, output: str | pathlib.Path | None, overwrite: bool) -> dict[pathlib.Path, bags.Bag]:
    """Return {file to write: the bag of one beam}. Raises FileExistsError, and ValueError for one file with several
    beams.
    """
    views = [bag.view(prefix[:-1]) for prefix in nodes.prefixes(bag.beams)]
    output = pathlib.Path(output) if output is not None else bag.file.parent / 'export'
    if output.suffix == '.tdm':
        if len(views) > 1:
            raise ValueError(f'--output {output}: must be a folder, because {bag.path} has {len(views)} beams')
        files = {output: views[0]}
    else:
        name = bag.path.resolve().stem
        files = {output / f'{".".join(filter(None, (name, view.beam.removesuffix("/"))))}.tdm': view for view in views}
    for file in files:
        if file.exists() and not overwrite:
            raise FileExistsError(f'{file} exists already; --overwrite replaces the file')
    return files


class _Tracks:
    """The exported steps of a bag of one beam, at most `rate` a second."""

    def __init__(self, bag: bags.Bag, rate: Hertz) -> None:
        self.bag = bag
        self.utc_of_zero = _utc_of_zero(bag)    # UTC of time 0 of the scenario, whose stamp is bag.start
        rows = {topic: bag.rows(topic) for topic in TOPIC_COLUMNS if topic in bag.topics}
        self.rows = {topic: of for topic, of in rows.items() if of.size}
        missing = [name for name in ('joint_states', 'tracking_receiver/angle_error') if name not in self.rows]
        if missing:
            raise bags.BagError(f'{bag.path}: no message of {missing[0]} in the bag')
        stamps = np.unique(self.rows['joint_states'].stamp)
        # In each interval of 1 / rate, only the first step is exported.
        _, first = np.unique((stamps - stamps[:1]) * rate // 1e9, return_index=True)
        self.stamps: Stamps = stamps[first]     # of these steps

    def segments(self) -> Iterator[_Segment]:
        for at in range(0, len(self.stamps), SEGMENT_STEPS):
            stamps = self.stamps[at:at + SEGMENT_STEPS]
            beam, error = self._at('joint_states', stamps), self._at('tracking_receiver/angle_error', stamps)
            attitude = self._at('ship/imu/data', stamps) if 'ship/imu/data' in self.rows else None
            t = (stamps - self.bag.start) / 1e9
            beam = directions.on_sky(self.bag, t, beam)
            angles = np.degrees(directions.of_target(beam, error[:, :2], attitude))
            mode = recordings.modes(self.bag, t)
            # Without lock the receiver errors, and so the angles, are NaN. A bag without acu/mode states no mode.
            exported = np.isfinite(angles).all(axis=1) & ((mode == 'autotrack') | ('acu/mode' not in self.bag.topics))
            if exported.any():
                passed = np.round((stamps[exported] - self.bag.start) / 1e3).astype('m8[us]')
                range_m, cn0_dbhz = self._at('tracking_receiver/range', stamps)[:, 0], error[:, 2]
                yield _Segment(instant.utc_texts(self.utc_of_zero, passed), angles[exported],
                               1e-3 * range_m[exported], cn0_dbhz[exported])

    def _at(self, topic: str, stamps: Stamps) -> Floats:
        """Return the k TOPIC_COLUMNS of a topic at n stamps, as (n, k); NaN where no message has the stamp."""
        out = np.full((len(stamps), len(TOPIC_COLUMNS[topic])), np.nan)
        rows = self.rows.get(topic, self.bag.index[:0].view(np.recarray))
        _, here, there = np.intersect1d(stamps, rows.stamp, return_indices=True)
        if here.size:
            chosen = rows[there].view(np.recarray)
            try:
                table = columns.table([data for *_, data in self.bag.take(chosen)], self.bag.topics[topic], chosen.log)
            except ValueError as error:
                raise bags.BagError(f'{self.bag.path}: {topic}: {error}') from None
            for i, name in enumerate(TOPIC_COLUMNS[topic]):
                out[here, i] = table.get(name, np.nan)
        return out


def _utc_of_zero(bag: bags.Bag) -> np.datetime64:
    """Return the UTC of the time 0 of a bag of one beam, in microseconds. Raises bag.BagError if it has no date.

    For a target with a date (a satellite, a flight with a date), the receiver publishes this UTC. For another target
    it is the start stamp of a realtime recording, which is UTC. A lockstep recording starts at stamp 0, which is no
    date.
    """
    date = bag.last_values(f'{bag.beam}tracking_receiver').get('stamp_0_utc', '')
    if date:
        begin: datetime.datetime = orbit.instant(f'{bag.path}: stamp_0_utc', date)
        return np.datetime64(begin, 'us')
    if bag.start:
        return np.datetime64(bag.start // 1000, 'us')
    raise bags.BagError(f'{bag.path}: the bag has no date, which a tracking data message needs; a lockstep run has a '
                        'date only if its target is a satellite or a flight with a date')


def _header(bag: bags.Bag, created: datetime.datetime) -> str:
    run = ', '.join(filter(None, (bag.metadata.get('scenario', ''), f'seed {bag.metadata.get("seed", "unknown")}',
                                  bag.metadata.get('pacing', ''))))
    run = ''.join(letter if ' ' <= letter <= '~' else '?' for letter in run[:200])
    return ('CCSDS_TDM_VERS = 2.0\n'
            f'COMMENT pedestal: {run}\n'
            f'CREATION_DATE = {created:%Y-%m-%dT%H:%M:%S}\n'
            'ORIGINATOR = PEDESTAL\n')


def _participants(bag: bags.Bag, names: Sequence[str]) -> tuple[str, ...]:
    """Return (name of the station, name of the target): the names that were given, else the default names."""
    receiver = recordings.parameters(bag, 'tracking_receiver')
    target = str(receiver.get('target.kind', 'TARGET')).upper()[:80]
    launch = TLE_DESIGNATOR_PATTERN.fullmatch(str(receiver.get('target.leo_pass.line_1', ''))[TLE_DESIGNATOR_COLUMNS])
    elements = receiver.get('target.leo_pass.omm', '')
    if target == 'LEO_PASS' and elements:
        target = json.loads(elements).get('OBJECT_ID', target)
    elif target == 'LEO_PASS' and launch:
        year, number, piece = launch.groups()
        # A year has two digits: 57 (the first satellite) to 99 are 19xx, 00 to 56 are 20xx.
        target = f'{1900 + int(year) + 100 * (int(year) < 57)}-{number}{piece}'
    return (*names, *(DEFAULT_STATION_NAME, target
                      if PARTICIPANT_PATTERN.fullmatch(target) else 'TARGET')[len(names):])


def _segment(segment: _Segment, participants: Sequence[str], models: Sequence[str]) -> str:
    """Return the text of a segment, with the keywords in the order of table 3-3 of CCSDS 503.0-B-2."""
    times, angles, distance, cn0 = segment
    lines = ['META_START', 'COMMENT angles = encoders + error of the receiver, not corrected for refraction',
             *(f'COMMENT pointing model: {title}' for title in models),
             'TIME_SYSTEM = UTC', f'START_TIME = {times[0]}', f'STOP_TIME = {times[-1]}',
             f'PARTICIPANT_1 = {participants[0]}', f'PARTICIPANT_2 = {participants[1]}',
             'MODE = SEQUENTIAL', 'PATH = 2,1', 'TIMETAG_REF = RECEIVE',
             *(('RANGE_UNITS = km',) if np.isfinite(distance).any() else ()),
             'ANGLE_TYPE = AZEL', 'DATA_QUALITY = RAW', 'META_STOP', 'DATA_START']
    azimuth = np.round(angles[:, 0], 6) % 360.0
    for time, a, e, r, c in zip(times, azimuth.tolist(), angles[:, 1].tolist(), distance.tolist(), cn0.tolist()):
        lines += [f'ANGLE_1 = {time} {a:.6f}', f'ANGLE_2 = {time} {e:.6f}']
        if np.isfinite(r):
            lines.append(f'RANGE = {time} {r:.6f}')
        if np.isfinite(c):
            lines.append(f'PC_N0 = {time} {c:.2f}')
    return '\n'.join([*lines, 'DATA_STOP', ''])
