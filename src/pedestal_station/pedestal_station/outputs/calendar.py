"""The taken passes of a night as iCalendar (RFC 5545). Equal nights give equal bytes, because the stamp of each event
is the beginning of the night. An event has ten lines, so this needs no library; a test reads them by one."""
import math
import re
from collections.abc import Iterator

from pedestal_station.night import Line, Night
from pedestal_station.outputs import words

MAX_LINE_BYTES = 75  # largest length of a line without its end (RFC 5545, 3.1) [bytes]
UTC_FORM = '%Y%m%dT%H%M%SZ'


def text(night: Night) -> str:
    """Return the calendar with an event for each taken pass."""
    content = ['BEGIN:VCALENDAR', 'VERSION:2.0', 'PRODID:-//pedestal//plan//EN', 'CALSCALE:GREGORIAN']
    for line in night.lines:
        if line.share.taken:
            content += _event(night, line)
    return ''.join(f'{folded}\r\n' for each in (*content, 'END:VCALENDAR') for folded in _folded(each))


def _event(night: Night, line: Line) -> list[str]:
    each, share = line.each, line.share
    station, prediction = night.station, each.prediction
    azimuths = [math.degrees(angle) % 360.0 for angle in prediction.azimuth]
    # A plan with newer elements moves a culmination by seconds, so the identity of a pass counts whole minutes.
    identity = '-'.join((re.sub(r'\W+', '_', each.object.number or each.object.name),
                         f'{words.utc(night, each.window.culmination):%Y%m%dT%H%M}',
                         f'{station.latitude_deg:.4f}', f'{station.longitude_deg:.4f}'))
    notes = [f'highest {math.degrees(each.window.max_elevation):.1f} deg at '
             f'{words.utc(night, each.window.culmination):%H:%M:%S} UTC',
             f'azimuth {azimuths[0]:.0f} to {azimuths[1]:.0f} deg', f'expected loss {prediction.loss:.1f} s',
             *([words.decision(night, share)] if share.reason else [])]
    return ['BEGIN:VEVENT', f'UID:{identity}@pedestal', f'DTSTAMP:{night.begin:{UTC_FORM}}',
            f'DTSTART:{words.utc(night, share.begin):{UTC_FORM}}', f'DTEND:{words.utc(night, share.end):{UTC_FORM}}',
            f'SUMMARY:{_escaped(each.case)}', f'DESCRIPTION:{_escaped("; ".join(notes))}',
            f'LOCATION:{_escaped(words.place(night))}', f'GEO:{station.latitude_deg:.6f};{station.longitude_deg:.6f}',
            'END:VEVENT']


def _escaped(content: str) -> str:
    """Return a text without control characters, and with the escapes of RFC 5545, 3.3.11."""
    return re.sub(r'[\\;,]', r'\\\g<0>', ''.join(filter(str.isprintable, content)))


def _folded(line: str) -> Iterator[str]:
    """Yield the parts of a line, of which each but the first begins with a blank. No part splits a character."""
    part = ''
    for letter in line:
        if len(f'{part}{letter}'.encode()) > MAX_LINE_BYTES:
            yield part
            part = ' '
        part += letter
    yield part
