"""`pedestal export`: write a recording as one table per topic, for MATLAB, pandas and other readers of CSV or Parquet.

A row is one message. The first two columns are its stamp in seconds and in integer nanoseconds. Each further column is
one number of the message (columns.table). A trajectory of several points has one row per point, and a diagnostics
message has one row per status.
"""
import contextlib
import csv
import os
import pathlib
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import TypeAlias

import numpy as np

from pedestal_common.graph import layouts, nodes
from pedestal_common.quantities import Floats, Stamps, Table
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_recording import columns

TIME_COLUMN, STAMP_COLUMN = 't [s]', 'stamp [ns]'
_TableWriter: TypeAlias = Callable[[pathlib.Path, Table, dict[str, str]], None]     # file, table, metadata


def export(path: str | pathlib.Path, file_format: str = 'csv', output: str | pathlib.Path | None = None,
           names: Collection[str] = (),
           overwrite: bool = False, more: Mapping[str, Table] | None = None,
           ) -> Iterator[tuple[pathlib.Path, int, int] | tuple[None, str, str]]:
    """Write the topics of the bag at a path as tables ('csv' or 'parquet').

    Yield (file, number of rows, number of columns) per table, or (None, reason, name) for a topic that is omitted.

    names         topics to write, each of a known type; when empty, all topics except those of unknown type
    output        folder of the tables, by default `export` in the bag (beside a bare .mcap). The table of the topic
                  acu/rate_command is `acu.rate_command.csv`.
    more          {name: further table}, with TIME_COLUMN and STAMP_COLUMN

    Raises bag.BagError, ValueError if Parquet cannot be written, or FileExistsError before the first write.
    """
    write = _parquet_writer() if file_format == 'parquet' else write_csv
    bag = bags.read(path)
    chosen = bags.chosen_topics(bag, names) if names else list(bag.topics)
    folder = pathlib.Path(output) if output is not None else bag.file.parent / 'export'
    more = more or {}
    files = {name: folder / f'{name.replace("/", ".")}.{file_format}' for name in (*chosen, *more)}
    existing = [file for file in files.values() if file.exists()]
    if existing and not overwrite:
        others = f' and {len(existing) - 1} more' if len(existing) > 1 else ''
        raise FileExistsError(f'{existing[0]} exists already{others}; --overwrite replaces the files')
    folder.mkdir(parents=True, exist_ok=True)
    for name, file in files.items():
        if name in more:
            content, origin = more[name], {}
        elif bag.topics[name] not in messages.ROS_TYPESTORE.fielddefs:
            reason = f'{name} is of the unknown type {bag.topics[name]}'
            if names:
                raise bags.BagError(f'{path}: {reason}')
            yield None, reason, name
            continue
        else:
            content, origin = table(bag, name), {'topic': name, 'type': bag.topics[name]}
        with atomic_file(file) as part:
            write(part, content, {**origin, **bag.metadata})
        yield file, len(content[STAMP_COLUMN]), len(content)


@contextlib.contextmanager
def atomic_file(file: pathlib.Path) -> Iterator[pathlib.Path]:
    """Yield the path of a temporary file, which becomes `file` at the end, or is removed after an error."""
    part = file.with_name(file.name + '.part')
    try:
        yield part
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def table(bag: bags.Bag, name: str) -> Table:
    """Return the columns of a topic by their headers: `t [s]`, `stamp [ns]`, then its columns, each with its unit."""
    type_name = bag.topics[name]
    rows = bag.rows(name)
    stamps = rows.stamp
    if type_name == 'diagnostic_msgs/msg/DiagnosticArray':
        return _diagnostics(bag, name, stamps)
    if type_name == 'trajectory_msgs/msg/JointTrajectory' and _has_tracks(bag, name):
        return _tracks(bag, name, stamps)
    numbers = bag.table(name)
    del numbers['t']
    return {**_times(stamps), **{_header(name, type_name, column): values for column, values in numbers.items()}}


def _times(stamps: Stamps) -> Table:
    return {TIME_COLUMN: stamps / 1e9, STAMP_COLUMN: stamps}


def _header(name: str, type_name: str, column: str) -> str:
    unit = layouts.unit(nodes.plain(name), type_name, column)
    return f'{column} [{unit}]' if unit else column


def _has_tracks(bag: bags.Bag, name: str) -> bool:
    """Return True if a trajectory message of the topic has more or fewer than one point.

    Because the number of points determines the length in bytes, one message of each length is read.
    """
    of_length = {len(data): data for _, _, _, data in bag.raw(name)}
    try:
        return any(len(messages.deserialize(data, bag.topics[name]).points) != 1 for data in of_length.values())
    except ValueError:
        return False


def _tracks(bag: bags.Bag, name: str, stamps: Stamps) -> Table:
    """Return the table of a topic of trajectories of several points. A row is a point, with time_from_start."""
    type_name = bag.topics[name]
    points = []
    for stamp, (_, _, _, message) in zip(stamps.tolist(), bag.messages(name)):
        for point in message.points:
            row = {'time_from_start': point.time_from_start.sec + point.time_from_start.nanosec * 1e-9}
            for field, values in (('position', point.positions), ('velocity', point.velocities),
                                  ('acceleration', point.accelerations), ('effort', point.effort)):
                row.update({f'{joint}.{field}': value for joint, value in zip(message.joint_names, values)})
            points.append((stamp, row))
    return {**_times(np.array([stamp for stamp, _ in points], np.int64)),
            **{_header(name, type_name, column): np.array([row.get(column, np.nan) for _, row in points], float)
               for column in dict.fromkeys(column for _, row in points for column in row)}}


def _diagnostics(bag: bags.Bag, name: str, stamps: Stamps) -> Table:
    statuses = [(stamp, status) for stamp, (_, _, _, message) in zip(stamps.tolist(), bag.messages(name))
                for status in message.status]
    return {**_times(np.array([stamp for stamp, _ in statuses], np.int64)),
            'level': np.array([status.level for _, status in statuses], np.int64),
            'name': [status.name for _, status in statuses], 'message': [status.message for _, status in statuses],
            'values': [columns.values_text((value.key, value.value) for value in status.values)
                       for _, status in statuses]}


def write_csv(file: pathlib.Path, content: Table, _description: object = None) -> None:
    """Write a table as CSV. A number is the shortest text that reads back as the same float, else NaN."""
    with open(file, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(content)
        writer.writerows(zip(*(_texts(values) for values in content.values())))


def _texts(values: Floats | Stamps | list[str]) -> Floats | Stamps | list[str]:
    if isinstance(values, list) or values.dtype.kind == 'i':
        return values
    return ['NaN' if value != value else repr(value) for value in values.tolist()]


def _parquet_writer() -> _TableWriter:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ValueError("Parquet needs pyarrow, which is not installed: pip install pyarrow, or the extra "
                         "'pedestal_recording[parquet]'") from None

    def write(file: pathlib.Path, content: Table, description: dict[str, str]) -> None:
        arrays = {header: pyarrow.array(values, pyarrow.string()) if isinstance(values, list) else values
                  for header, values in content.items()}
        pyarrow.parquet.write_table(pyarrow.table(arrays).replace_schema_metadata(description), file,
                                    compression='zstd')
    return write
