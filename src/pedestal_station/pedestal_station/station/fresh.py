"""Watch of a folder into which another program writes files of elements. Nothing is downloaded.

A file counts once its size and its time of change are equal in two looks: this leaves out a file that is being
written. A thread reads it, because a catalogue takes a second.
"""
import contextlib
import datetime
import pathlib
from collections.abc import Sequence
from concurrent import futures
from typing import TypeAlias

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Seconds
from pedestal_station import objects
from pedestal_station.outputs.file import UNIX_EPOCH, texts_of
from pedestal_station.station.requests import Antenna
from pedestal_station.station.sequence import Fresh

LOOK_PERIOD_S = 3.0  # time between two looks at the folder [s]
NIGHT_S = SECONDS_PER_DAY  # length of the night for which elements are read [s]
HIDDEN_PREFIX = '.'  # of the names of files that a program has not finished

_Version: TypeAlias = tuple[int, int]   # of a file: time of its last change [ns], size [bytes]


class Watch:
    """Watch of a folder for elements of the wanted satellites. Raises NotADirectoryError for a missing folder."""

    def __init__(self, folder: pathlib.Path, antenna: Antenna) -> None:
        if not folder.is_dir():
            raise NotADirectoryError(f'--elements {folder}: must be a directory that exists')
        self._folder, self._antenna = folder, antenna
        self._seen: dict[pathlib.Path, _Version] = {}
        self._read: dict[pathlib.Path, _Version] = {}
        self._wanted = frozenset[str]()     # of the files that were read
        self._worker = futures.ThreadPoolExecutor(1, 'elements')
        self._pending: futures.Future[tuple[list[Fresh], list[str]]] | None = None
        self._next = 0.0

    def look(self, now: Seconds, wanted: frozenset[str], utc: Seconds) -> tuple[list[Fresh], list[str]]:
        """Return (elements that were read since the last call, lines about files that cannot be read). now: steady
        time; wanted: catalogue numbers or names; utc: the begin of the night that the elements are for."""
        found: tuple[list[Fresh], list[str]] = [], []
        if self._pending is not None and self._pending.done():
            found, self._pending = self._pending.result(), None
        if self._pending is None and now >= self._next:
            self._next = now + LOOK_PERIOD_S
            if files := self._changed(wanted):
                self._pending = self._worker.submit(read, files, wanted, self._antenna, utc)
        return found

    def _changed(self, wanted: frozenset[str]) -> list[pathlib.Path]:
        """Return the quiet files that were not read in their present version for all that is wanted."""
        versions: dict[pathlib.Path, _Version] = {}
        with contextlib.suppress(OSError):      # the other program removes a file, or replaces the folder
            for path in sorted(self._folder.iterdir()):
                if not path.name.startswith(HIDDEN_PREFIX) and path.is_file():
                    info = path.stat()
                    versions[path] = info.st_mtime_ns, info.st_size
        quiet = {path: version for path, version in versions.items() if self._seen.get(path) == version}
        known = self._read if wanted <= self._wanted else {}
        self._seen, self._read, self._wanted = versions, quiet, wanted
        return [path for path, version in quiet.items() if known.get(path) != version]

    def close(self) -> None:
        """End without waiting for a file."""
        self._worker.shutdown(wait=False, cancel_futures=True)


def read(paths: Sequence[pathlib.Path], wanted: frozenset[str], antenna: Antenna,
         utc: Seconds) -> tuple[list[Fresh], list[str]]:
    """Return (elements of the wanted satellites in files, a line for each file and wanted satellite that is refused).
    """
    begin, fresh, lines = UNIX_EPOCH + datetime.timedelta(seconds=utc), list[Fresh](), list[str]()
    for path in paths:
        try:
            found, refused = objects.read([path], antenna.station, begin, NIGHT_S, antenna.oldest)
        except Exception as error:      # no file of another program may end the night
            lines.append(f'refused: {path}: {error}')
            continue
        fresh += [Fresh(each.number or each.name, texts_of(each.orbit), path.name) for each in found
                  if (each.number or each.name) in wanted and isinstance(each.orbit, objects.Elements)]
        lines += [f'refused: {each.path}: line {each.line}: {each.reason}' for each in refused
                  if not each.line or each.name in wanted]
    return fresh, lines
