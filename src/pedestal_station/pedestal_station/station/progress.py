"""Progress of a night: the JSON of `station/night`, and the small file beside the plan from which a station that is
started again continues."""
import json
import os
import pathlib

from pedestal_common.geometry import orbit
from pedestal_common.quantities import Json, Seconds
from pedestal_common.text_files import files
from pedestal_station.outputs.file import PlanError, contact, row, seconds, utc_text
from pedestal_station.station.sequence import Entry, State

SUFFIX = '.progress'  # of the file beside the plan
VERSION_KEY, VERSION = 'pedestal_station', 1
STATES = 'queued', 'running', 'done', 'failed', 'skipped', 'dropped'
MAX_PROGRESS_BYTES = 50_000_000  # largest size of the file [bytes]
MAX_SHIFT_S = 60.0  # largest shift of the begin of a pass between two plans that still counts as the same pass [s]


def night_text(state: State) -> str:
    """Return the JSON of `station/night`."""
    return json.dumps({'passes': [
        {'case': entry.contact.case, 'begin': entry.contact.begin, 'end': entry.contact.end,
         'max_elevation_deg': round(entry.contact.max_elevation, 2), 'state': entry.state,
         'text': '; '.join(filter(None, (entry.text, entry.report)))} for entry in state.entries], 'now': state.now})


def file_of(plan: pathlib.Path) -> pathlib.Path:
    """Return the file of the progress of a plan."""
    return plan.with_name(plan.name + SUFFIX)


def save(path: pathlib.Path, state: State) -> None:
    """Replace the file by one with a state, in one operation. Raises OSError."""
    entries = [{'case': entry.contact.case, 'begin': utc_text(entry.contact.begin), 'state': entry.state,
                'text': entry.text, 'tracked_s': round(entry.tracked, 1), 'report': entry.report,
                **({'inserted': row(entry.contact)} if entry.inserted else {})} for entry in state.entries]
    new = path.with_name(path.name + '.new')
    new.write_text(json.dumps({VERSION_KEY: VERSION, 'held': state.held, 'passes': entries}, indent=1) + '\n')
    os.replace(new, path)


def resume(state: State, path: pathlib.Path, now: Seconds) -> State:
    """Return the state at the begin of a night with the progress of a file, if there is one. A pass that was under way
    and whose time is not over runs again. Raises PlanError for a broken file."""
    try:
        content = json.loads(files.read_text(path, MAX_PROGRESS_BYTES))
        if content[VERSION_KEY] != VERSION:
            raise ValueError(f'{VERSION_KEY} = {content[VERSION_KEY]!r:.20}: must be {VERSION}')
        held = _text(content['held'])
        known = {str(saved['case']): saved for saved in content['passes']}
        entries = [_continued(entry, known[entry.contact.case], now) if entry.contact.case in known else entry
                   for entry in state.entries]
        cases = [entry.contact.case for entry in entries]
        entries += [_continued(_inserted(path, saved, now), saved, now) for case, saved in known.items()
                    if 'inserted' in saved and case not in cases]
    except FileNotFoundError:
        return state
    except PlanError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise PlanError(f'{path}: holds no progress of a night ({error!r:.100}); remove it to take all passes again'
                        ) from None
    return state._replace(entries=tuple(sorted(entries, key=lambda entry: entry.contact.begin)), held=held)


def _text(value: Json) -> str:
    if not isinstance(value, str):
        raise TypeError(f'{value!r:.40}: must be a text')
    return value


def _inserted(path: pathlib.Path, saved: dict[str, Json], now: Seconds) -> Entry:
    kept = contact(str(path), f'{saved["case"]}.inserted.', saved['inserted'])
    return Entry(kept, 'queued' if kept.end > now else 'skipped', 'its time went by: the station was off',
                 inserted=True)


def _continued(entry: Entry, saved: dict[str, Json], now: Seconds) -> Entry:
    """Return an entry with its progress. Another pass of the same name is left as it is."""
    if saved['state'] not in STATES:
        raise ValueError(f'state = {saved["state"]!r:.20}: must be one of {", ".join(STATES)}')
    begin = entry.contact.begin
    if abs(begin - seconds(orbit.instant('begin', _text(saved['begin'])))) > MAX_SHIFT_S:
        return entry
    tracked, report = float(saved['tracked_s']), _text(saved['report'])
    state, text = str(saved['state']), _text(saved['text'])
    if state == 'queued':
        # `insert` has queued a pass that the plan drops.
        return entry._replace(state=state, text=text) if entry.contact.end > now else entry
    if state == 'running' and entry.contact.end <= now:
        state, text = 'failed', 'the station was off at its end'
    return entry._replace(state=state, text=text, tracked=tracked, report=report)
