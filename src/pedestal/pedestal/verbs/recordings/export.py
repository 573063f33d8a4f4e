"""write a recording as one table per topic, CSV or Parquet, or its tracking data as a CCSDS TDM"""
import pathlib
import sys


def add_arguments(parser):
    """Bag, format, output folder, topics; rate and participants of a TDM."""
    parser.add_argument('bag', type=pathlib.Path)
    parser.add_argument('--format', choices=('csv', 'parquet', 'tdm'), default='csv', help='tdm: where the beam saw '
                        'the target, for orbit determination (CCSDS 503.0-B-2); default: csv')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='of a tdm also a file that ends in .tdm; '
                        'default: export in the bag')
    parser.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='default: all')
    parser.add_argument('--rate', type=float, metavar='HZ', help='tdm: records a second; default: 10')
    parser.add_argument('--participants', nargs=2, metavar=('STATION', 'TARGET'), help='tdm: their names; default: '
                        'PEDESTAL and the international designator of the TLE')
    parser.add_argument('--overwrite', action='store_true', help='replace files that are there')


def main(options):
    """Write the files and print one line for each."""
    if options.format == 'tdm':
        return _tracking_data(options)
    if options.rate is not None or options.participants:
        raise ValueError(f'--rate, --participants: are of --format tdm, not of {options.format}')
    from pedestal_recording.export import export
    for file, rows, columns in export(options.bag, options.format, options.output, options.topics, options.overwrite):
        if file is None:
            print(f'pedestal: left out: {rows}', file=sys.stderr)
        else:
            print(f'{file}  {rows} rows, {columns} columns')
    return 0


def _tracking_data(options):
    import datetime

    from pedestal_analysis.report import tdm
    if options.topics:
        raise ValueError('--topics: a tdm is made of those that say where the target was')
    created = datetime.datetime.now(datetime.timezone.utc)
    rate = 10.0 if options.rate is None else options.rate
    for file, records in tdm.export(options.bag, created, options.output, rate, options.participants or (),
                                    options.overwrite):
        print(f'{file}  {records} records')
    return 0
