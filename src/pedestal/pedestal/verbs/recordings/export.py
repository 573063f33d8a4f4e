"""write a recording as one table per topic, CSV or Parquet, or its tracking data as a CCSDS TDM"""
import argparse
import pathlib
import sys


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add bag, format, output folder, topics; rate and participants of a TDM."""
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    parser.add_argument('--format', choices=('csv', 'parquet', 'tdm'), default='csv', help='output format; tdm: '
                        'directions of the target for orbit determination (CCSDS 503.0-B-2); default: csv')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder, or with tdm also a .tdm '
                        'file; default: folder export in the bag')
    parser.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='topics to export; '
                        'default: all')
    parser.add_argument('--rate', type=float, metavar='HZ', help='largest rate of the records of a tdm [Hz]; default: '
                        '10')
    parser.add_argument('--participants', nargs=2, metavar=('STATION', 'TARGET'), help='names of station and target '
                        'in a tdm; default: station PEDESTAL; target: international designator of the TLE, or, if '
                        'there is no TLE, the kind of the target')
    parser.add_argument('--overwrite', action='store_true', help='replace existing files')


def main(options: argparse.Namespace) -> int:
    """Write the files and print a line for each. Return exit code 0."""
    if options.format == 'tdm':
        return _tracking_data(options)
    if options.rate is not None or options.participants:
        raise ValueError(f'--rate, --participants: need --format tdm, not {options.format}')
    from pedestal_recording.export import export
    for file, rows_or_reason, columns in export(options.bag, options.format, options.output, options.topics,
                                                options.overwrite):
        if file is None:     # a topic that cannot be exported
            print(f'pedestal: left out: {rows_or_reason}', file=sys.stderr)
        else:
            print(f'{file}  {rows_or_reason} rows, {columns} columns')
    return 0


def _tracking_data(options: argparse.Namespace) -> int:
    """Write the tracking data as a tracking data message (TDM). Return exit code 0."""
    import datetime

    from pedestal_results import tdm
    if options.topics:
        raise ValueError('--topics: a tdm is made of fixed topics, the option is for csv and parquet')
    created = datetime.datetime.now(datetime.timezone.utc)
    rate = 10.0 if options.rate is None else options.rate
    for file, records in tdm.export(options.bag, created, options.output, rate, options.participants or (),
                                    options.overwrite):
        print(f'{file}  {records} records')
    return 0
