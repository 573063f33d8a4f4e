"""write a recording as one HTML file with its figures"""
import pathlib

from pedestal.verbs import arguments


def add_arguments(parser):
    """Bag, beam, output file, folder of the figures."""
    parser.add_argument('bag', type=pathlib.Path)
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='default: report.html in the bag')
    arguments.add_beam(parser)
    parser.add_argument('--png', type=pathlib.Path, metavar='DIR', help='also write each figure as PNG')
    arguments.add_vector(parser)


def main(options):
    """Write the report and print its path."""
    from pedestal_analysis.report import page
    if options.vector and not options.png:
        raise ValueError(f'--vector {options.vector}: needs --png DIR, the folder of the figures')
    print(page.write(options.bag, options.output, options.png, options.beam, options.vector))
    return 0
