"""write a recording as one table per topic, CSV or Parquet"""
import pathlib
import sys


def add_arguments(parser):
    """Bag, format, output folder, topics."""
    parser.add_argument('bag', type=pathlib.Path)
    parser.add_argument('--format', choices=('csv', 'parquet'), default='csv', help='default: csv')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='default: export in the bag')
    parser.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='default: all')
    parser.add_argument('--overwrite', action='store_true', help='replace tables that are there')


def main(options):
    """Write the tables and print one line for each."""
    from pedestal_bringup.bags.export import export
    for file, rows, columns in export(options.bag, options.format, options.output, options.topics, options.overwrite):
        if file is None:
            print(f'pedestal: left out: {rows}', file=sys.stderr)
        else:
            print(f'{file}  {rows} rows, {columns} columns')
    return 0
