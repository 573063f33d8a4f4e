"""Progress of a night: the JSON of `station/night`, and the small file beside the plan from which a station that is
started again continues."""
import json
import os
import pathlib

from pedestal_common.geometry import orbit
from pedestal_common.graph.topics import PASS_STATES
from pedestal_common.quantities import Json, Seconds
from pedestal_common.text_files import files
from pedestal_station.outputs.file import PlanError, contact, row, seconds, utc_text
from pedestal_station.station.sequence import Entry, PassSequence

SUFFIX = '.progress'  # of the file beside the plan
VERSION_KEY, VERSION = 'pedestal_station', 1
MAX_PROGRESS_BYTES = 50_000_000  # largest size of the file [bytes]
MAX_SHIFT_S = 60.0  # largest shift of the begin of a pass between two plans that still counts as the same pass [s]


def night_text(sequence: PassSequence) -> str:
    """Return the JSON of `station/night`."""
    passes = [
        {'case': entry.contact.case, 'begin': entry.contact.begin, 'end': entry.contact.end,
         'max_elevation_deg': round(entry.contact.max_elevation_deg, 2), 'state': entry.state,
         'text': '; '.join(filter(None, (entry.text, entry.report)))} for entry in sequence.entries]
    return json.dumps({'passes': passes, 'now': sequence.now})


def file_of(plan: pathlib.Path) -> pathlib.Path:
    """Return the file of the progress of a plan."""
    return plan.with_name(plan.name + SUFFIX)


def save(path: pathlib.Path, sequence: PassSequence) -> None:
    """Replace the file by one with the present progress, in one operation. Raises OSError."""
    entries = [{'case': entry.contact.case, 'begin': utc_text(entry.contact.begin), 'state': entry.state,
                'text': entry.text, 'tracked_s': round(entry.tracked, 1), 'report': entry.report,
                **({'inserted': row(entry.contact)} if entry.inserted else {})} for entry in sequence.entries]
    new = path.with_name(path.name + '.new')
    new.write_text(json.dumps({VERSION_KEY: VERSION, 'held': sequence.held, 'passes': entries}, indent=1) + '\n')
    os.replace(new, path)


def resume(sequence: PassSequence, path: pathlib.Path, now: Seconds) -> None:
    """Take the progress of a file, if there is one, at the begin of a night. A pass that was under way and whose time
    is not over runs again. Raises PlanError for a broken file."""
    try:
        content = json.loads(files.read_text(path, MAX_PROGRESS_BYTES))
        if content[VERSION_KEY] != VERSION:
            raise ValueError(f'{VERSION_KEY} = {content[VERSION_KEY]!r:.20}: must be {VERSION}')
        known = {entry.contact.case: entry for entry in sequence.entries}
        for saved in content['passes']:
            case = _text(saved['case'])
            if case not in known and 'inserted' in saved:
                kept = contact(path, f'{case}.inserted', saved['inserted'])
                known[case] = Entry(kept, 'skipped', 'its time went by: the station was off', inserted=True)
            if case in known:
                _continue(known[case], saved, now)
        sequence.held = _text(content['held'])
        sequence.entries = sorted(known.values(), key=lambda entry: entry.contact.begin)
    except FileNotFoundError:
        pass
    except PlanError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise PlanError(f'{path}: holds no progress of a night ({error!r:.100}); remove it to take all passes again'
                        ) from None


def _text(value: Json) -> str:
    if not isinstance(value, str):
        raise TypeError(f'{value!r:.40}: must be a text')
    return value


def _continue(entry: Entry, saved: dict[str, Json], now: Seconds) -> None:
    """Give an entry its progress. Another pass of the same name is left as it is."""
    state, text, begin = saved['state'], _text(saved['text']), entry.contact.begin
    if state not in PASS_STATES:
        raise ValueError(f'state = {state!r:.20}: must be one of {", ".join(PASS_STATES)}')
    over = entry.contact.end <= now
    if (abs(begin - seconds(orbit.instant('begin', _text(saved['begin'])))) > MAX_SHIFT_S
            or state == 'queued' and over):
        return
    if state == 'running' and over:
        state, text = 'failed', 'the station was off at its end'
    entry.state, entry.text = state, text
    entry.tracked, entry.report = float(saved['tracked_s']), _text(saved['report'])
