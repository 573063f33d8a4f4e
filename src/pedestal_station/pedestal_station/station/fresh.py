"""Watch of a folder into which another program writes files of elements. Nothing is downloaded.

A file counts once its size and its time of change are equal in two looks: this leaves out a file that is being
written. A thread reads it, because a catalogue takes a second.
"""
import datetime
import pathlib
from collections.abc import Iterable
from concurrent import futures
from typing import NamedTuple

from pedestal_common.geometry.orbit import TargetError
from pedestal_common.quantities import Seconds
from pedestal_station.station.sequence import Fresh
from tracking_receiver_sim import elements

LOOK_PERIOD_S = 3.0  # time between two looks at the folder [s]
HIDDEN_PREFIX = '.'  # of the names of files that a program has not finished


class _Version(NamedTuple):
    """Version of a file."""
    time: int   # of its last change [ns]
    size: int   # [bytes]


class Watch:
    """Watch of a folder for elements of the wanted satellites. Raises NotADirectoryError for a missing folder."""

    def __init__(self, folder: pathlib.Path) -> None:
        if not folder.is_dir():
            raise NotADirectoryError(f'--elements {folder}: must be a directory that exists')
        self._folder = folder
        self._seen: dict[pathlib.Path, _Version] = {}
        self._read: dict[pathlib.Path, tuple[_Version, frozenset[str]]] = {}
        self._worker = futures.ThreadPoolExecutor(1, 'elements')
        self._pending: futures.Future[tuple[list[Fresh], list[str]]] | None = None
        self._next = 0.0

    def look(self, now: Seconds, wanted: frozenset[str], utc: datetime.datetime) -> tuple[list[Fresh], list[str]]:
        """Return (elements that were read since the last call, lines about files that cannot be read). now: steady
        time; wanted: catalogue numbers or names; utc: of several sets of a satellite that nearest to it is taken."""
        found: tuple[list[Fresh], list[str]] = [], []
        if self._pending is not None and self._pending.done():
            found, self._pending = self._pending.result(), None
        if self._pending is None and now >= self._next:
            self._next = now + LOOK_PERIOD_S
            if files := self._changed(wanted):
                self._pending = self._worker.submit(read, files, wanted, utc)
        return found

    def _changed(self, wanted: frozenset[str]) -> list[pathlib.Path]:
        """Return the quiet files that were not read in their present version for all that is wanted."""
        versions = {}
        for path in self._listed():
            try:
                info = path.stat()
            except OSError:
                continue
            versions[path] = _Version(info.st_mtime_ns, info.st_size)
        quiet = [path for path, version in versions.items() if self._seen.get(path) == version
                 and self._read.get(path) != (version, wanted)]
        self._seen = versions
        self._read |= {path: (versions[path], wanted) for path in quiet}
        return quiet

    def _listed(self) -> list[pathlib.Path]:
        try:
            return sorted(path for path in self._folder.iterdir() if not path.name.startswith(HIDDEN_PREFIX)
                          and path.is_file())
        except OSError:
            return []       # the other program replaces the folder

    def close(self) -> None:
        """End without waiting for a file."""
        self._worker.shutdown(wait=False, cancel_futures=True)


def read(paths: Iterable[pathlib.Path], wanted: frozenset[str],
         utc: datetime.datetime) -> tuple[list[Fresh], list[str]]:
    """Return (elements of the wanted satellites in files, a line for each file that cannot be read)."""
    found: list[Fresh] = []
    refused: list[str] = []
    for path in paths:
        for satellite in sorted(wanted):
            try:
                values = elements.read(path, satellite, utc).values
            except (TargetError, OSError) as error:
                if 'satellites: ' not in str(error):    # else the satellite is not in the file
                    refused.append(f'refused: {error}')
                    break
            else:
                found.append(Fresh(satellite, {name: text for name, text in values.items() if text}, path.name))
    return found, refused
