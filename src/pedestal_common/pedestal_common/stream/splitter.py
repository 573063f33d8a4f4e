"""Splitter of a stream of bytes into frames, such as lines of text."""
import re


class Overlong(bytes):
    """Begin of a frame that is too long."""


class Splitter:
    """Splitter into frames that end with one of the bytes `ends`, and have at most `longest` bytes before it."""
    rest: bytes     # begun frame
    skips: bool     # True until the end of a frame whose bytes are discarded

    def __init__(self, ends: bytes, longest: int) -> None:
        self._split, self._longest = re.compile(b'[' + re.escape(ends) + b']').split, longest
        self.restart()

    def restart(self, skips: bool = False) -> None:
        """Discard the begun frame. skips: True if the next bytes may begin within a frame, which is discarded."""
        self.rest, self.skips = b'', skips

    def take(self, data: bytes) -> list[bytes]:
        """Return the frames that these bytes end, and an Overlong for each frame that becomes too long."""
        *frames, self.rest = self._split(self.rest + data)
        if frames and self.skips:
            del frames[0]
            self.skips = False
        if self.skips:
            self.rest = b''
        found = [Overlong(frame) if len(frame) > self._longest else frame for frame in frames]
        if len(self.rest) > self._longest:
            found.append(Overlong(self.rest))
            self.restart(skips=True)
        return found
