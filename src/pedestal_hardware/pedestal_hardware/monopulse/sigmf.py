"""SigMF recordings of interleaved channels: a file of samples (.sigmf-data) and its JSON (.sigmf-meta).

Read are cf32_le and ci16_le; written is cf32_le. A capture begins where samples are missing (core:global_index) or
where the clock of the samples was set again (core:datetime, with nanoseconds).
"""
import contextlib
import datetime
import itertools
import json
import math
import pathlib
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Hertz, Json, Nanoseconds
from pedestal_hardware.monopulse.blocks import TIME_TOLERANCE_NS, Chunk, StreamError
from pedestal_hardware.monopulse.vita49 import INTEGER_FULL_SCALE

MAX_META_BYTES = 50_000_000  # largest size of a .sigmf-meta file [bytes]
MAX_CAPTURES = 50_000  # largest number of captures of a recording, whose .sigmf-meta file then has 6 MB
META_PERIOD_S = 1.0  # shortest time of recorded samples between two writes of the .sigmf-meta file [s]
CHUNK_SAMPLES = 65536  # number of samples that are read at once

Capture: TypeAlias = tuple[int, int, Nanoseconds]    # first sample in the file, number of this sample, its UTC

FORMATS = {'cf32_le': np.dtype('<c8'), 'ci16_le': np.dtype(('<i2', 2))}
META_SUFFIX, DATA_SUFFIX = '.sigmf-meta', '.sigmf-data'
_EPOCH = datetime.datetime(1970, 1, 1)
_TIME = re.compile(r'(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(?:\.(\d{1,12}))?Z')


def data_path(meta: str | pathlib.Path) -> pathlib.Path:
    """Return the path of the samples of a .sigmf-meta file."""
    return pathlib.Path(str(meta).removesuffix(META_SUFFIX) + DATA_SUFFIX)


def text_of(utc: Nanoseconds) -> str:
    """Return a UTC as the text of core:datetime."""
    seconds, rest = divmod(utc, NS_PER_SECOND)
    return f'{_EPOCH + datetime.timedelta(seconds=seconds):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z'


def utc_of(text: str) -> Nanoseconds:
    """Return the UTC of a core:datetime. Raises ValueError."""
    match = _TIME.fullmatch(text)
    if not match:
        raise ValueError(text)
    whole = datetime.datetime.strptime(match[1], '%Y-%m-%dT%H:%M:%S') - _EPOCH
    return round(whole.total_seconds()) * NS_PER_SECOND + int((match[2] or '0').ljust(9, '0')[:9])


def free_path(meta: str | pathlib.Path) -> str:
    """Return this path of a .sigmf-meta file, or the first of NAME-1, NAME-2, ... without a file."""
    base = str(meta).removesuffix(META_SUFFIX)
    names = itertools.chain((base,), (f'{base}-{k}' for k in itertools.count(1)))
    return next(name for name in names if not any(pathlib.Path(name + suffix).exists()
                                                  for suffix in (META_SUFFIX, DATA_SUFFIX))) + META_SUFFIX


class Recorder:
    """Writer of a recording. Raises StreamError for a path that exists or cannot be written. origin: `received` or
    `simulated`. The .sigmf-meta file lists a capture after META_PERIOD_S at the latest."""

    def __init__(self, meta: str | pathlib.Path, rate: Hertz, channels: Sequence[str], origin: str) -> None:
        self.meta, self.rate, self.channels = pathlib.Path(meta), rate, channels
        self.description = f'pedestal: {origin} {", ".join(channels)}'
        self.captures: list[str] = []           # their JSON
        self.count = 0                          # number of samples
        try:
            self.data = open(data_path(meta), 'xb')
            self._write_meta()
            self.next_meta = 0                  # the first capture is written at once
        except OSError as error:
            raise StreamError(f'{meta}: {error.strerror}; a recording is never overwritten') from None

    def write(self, chunk: Chunk, begins: bool) -> None:
        """Write a chunk. begins: True if a capture begins with it. Raises StreamError."""
        if begins and len(self.captures) == MAX_CAPTURES:
            raise StreamError(f'{self.meta}: {MAX_CAPTURES} captures: a recording must have no more gaps and changes '
                              'of its clock')
        with self._errors_named():
            if begins:
                self.captures.append(json.dumps({'core:sample_start': self.count, 'core:global_index': chunk.first,
                                                 'core:datetime': text_of(chunk.utc)}))
            if self.noted < len(self.captures) and self.count >= self.next_meta:
                self._write_meta()
            self.data.write(np.ascontiguousarray(chunk.samples).astype('<c8', copy=False).data)
            self.count += len(chunk.samples)

    @contextlib.contextmanager
    def _errors_named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise StreamError(f'{self.meta}: {error.strerror}') from None

    def _write_meta(self) -> None:
        content = {'core:datatype': 'cf32_le', 'core:sample_rate': self.rate, 'core:version': '1.0.0',
                   'core:num_channels': len(self.channels), 'core:description': self.description}
        captures = ',\n  '.join(self.captures)
        new = self.meta.with_name(self.meta.name + '.new')
        new.write_text(f'{{"global": {json.dumps(content, indent=1)},\n "captures": [\n  {captures}],\n '
                       '"annotations": []}\n')
        new.replace(self.meta)
        # noted: number of captures in the file; next_meta: number of samples from which the file is written again
        self.noted, self.next_meta = len(self.captures), self.count + round(META_PERIOD_S * self.rate)

    def close(self) -> None:
        """End the recording. Raises StreamError for a full disk."""
        with self._errors_named():
            try:
                if self.noted < len(self.captures):
                    self._write_meta()
            finally:
                self.data.close()


class Recording:
    """Recording that is read. Raises StreamError for a file that does not fit. rate: sample rate that the receiver
    needs, None for any; cut: text about samples that the file lacks, or ''."""

    def __init__(self, meta: str | pathlib.Path, channels: Sequence[str], rate: Hertz | None = None) -> None:
        self.meta, self.channels = pathlib.Path(meta), len(channels)
        head, captures = self._parsed()
        form = FORMATS.get(self._value(head, 'core:datatype', str))
        if form is None:
            raise StreamError(f'{meta}: core:datatype = {head["core:datatype"]!r:.40}: must be one of '
                              f'{", ".join(FORMATS)}')
        if 'core:dataset' in head and head['core:dataset'] != data_path(meta).name:
            raise StreamError(f'{meta}: core:dataset = {head["core:dataset"]!r:.60}: must be {data_path(meta).name}')
        self.type = form
        count = self._value(head, 'core:num_channels', int, 1)
        if count != self.channels:
            raise StreamError(f'{meta}: core:num_channels = {count}: must be {self.channels}: {", ".join(channels)}')
        self.rate = float(self._value(head, 'core:sample_rate', (int, float)))
        if not (math.isfinite(self.rate) and self.rate > 0.0) or rate is not None and self.rate != rate:
            raise StreamError(f'{meta}: core:sample_rate = {self.rate:g} S/s: must be '
                              f'{"above 0" if rate is None else f"{rate:g} S/s (source.rate)"}')
        item = self.channels * self.type.itemsize
        try:
            size = data_path(meta).stat().st_size
        except OSError as error:
            raise StreamError(f'{data_path(meta)}: {error.strerror}') from None
        self.count = size // item
        self.cut = '' if size % item == 0 else (f'{data_path(meta)}: {size} bytes are no multiple of {item}: the file '
                                                'is cut')
        self.captures = self._checked(captures)

    def _parsed(self) -> tuple[dict[str, Json], list[Json]]:
        try:
            if self.meta.stat().st_size > MAX_META_BYTES:
                raise StreamError(f'{self.meta}: above {MAX_META_BYTES} bytes')
            content = json.loads(self.meta.read_text())
        except OSError as error:
            raise StreamError(f'{self.meta}: {error.strerror}') from None
        except (ValueError, RecursionError) as error:
            raise StreamError(f'{self.meta}: no JSON: {str(error):.80}') from None
        if not (isinstance(content, dict) and isinstance(content.get('global'), dict)
                and isinstance(content.get('captures'), list)):
            raise StreamError(f'{self.meta}: must have an object `global` and a list `captures`')
        return content['global'], content['captures']

    def _value(self, part: Mapping[str, Json], name: str, kind: type | tuple[type, ...],
               otherwise: object = None) -> Json:
        value = part.get(name, otherwise)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise StreamError(f'{self.meta}: {name} = {value!r:.40}: must be '
                              f'{"a text" if kind is str else "a number"}')
        return value

    def _checked(self, captures: list[Json]) -> list[Capture]:
        found: list[Capture] = []
        for capture in captures:
            if not isinstance(capture, dict):
                raise StreamError(f'{self.meta}: captures: each must be an object')
            for name in ('core:header_bytes', 'core:trailing_bytes'):
                if capture.get(name, 0) != 0:
                    raise StreamError(f'{self.meta}: {name} = {capture[name]!r:.40}: must be 0; remove these bytes '
                                      'from the file of the samples')
            start = self._value(capture, 'core:sample_start', int)
            text = self._value(capture, 'core:datetime', str, text_of(0) if not found else None)
            try:
                utc = utc_of(text)
            except ValueError:
                raise StreamError(f'{self.meta}: core:datetime = {text!r:.40}: must be like '
                                  '2019-12-10T12:35:00.000000000Z') from None
            before = found[-1] if found else (0, 0, utc)
            index = before[1] + start - before[0]
            # A file without global_index may still have a gap, which its times show.
            expected = before[2] + round((start - before[0]) * NS_PER_SECOND / self.rate)
            index += max(round((utc - expected) * self.rate / NS_PER_SECOND), 0) \
                if utc - expected > TIME_TOLERANCE_NS else 0
            index = self._value(capture, 'core:global_index', int, index)
            if start < before[0] or (found and start == before[0]) or (found and index < before[1]):
                raise StreamError(f'{self.meta}: core:sample_start = {start}, core:global_index = {index}: must grow '
                                  'from capture to capture')
            found.append((start, index, utc))
        if not found or found[0][0] != 0:
            raise StreamError(f'{self.meta}: captures: the first must have core:sample_start = 0')
        if found[-1][0] > self.count:
            raise StreamError(f'{self.meta}: core:sample_start = {found[-1][0]}: must be at most {self.count}, the '
                              'number of samples in the file; the file is cut')
        return found

    def chunks(self) -> Iterator[Chunk]:
        """Yield the chunks of the recording."""
        data = np.memmap(data_path(self.meta), self.type, 'r', shape=(self.count, self.channels)) if self.count else ()
        ends = [start for start, *_ in self.captures[1:]] + [self.count]
        for (start, index, utc), end in zip(self.captures, ends):
            for first in range(start, end, CHUNK_SAMPLES):
                samples = np.array(data[first:min(first + CHUNK_SAMPLES, end)])
                if self.type.kind != 'c':
                    samples = (samples.astype(np.float32) / np.float32(INTEGER_FULL_SCALE)).view(np.complex64)[..., 0]
                offset = round((first - start) * NS_PER_SECOND / self.rate)
                yield Chunk(samples.astype(np.complex64, copy=False), index + first - start, utc + offset)
