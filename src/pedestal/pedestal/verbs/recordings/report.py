"""write a recording as one HTML file with its figures"""
import argparse
import pathlib

from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add bag, beam, output file, folder of the figures, author and PDF."""
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='output file; default: report.html in '
                        'the bag')
    arguments.add_beam(parser)
    parser.add_argument('--png', type=pathlib.Path, metavar='DIR', help='folder in which each figure is also '
                        'written as PNG')
    parser.add_argument('--author', default='', metavar='NAME', help='name of the author on the first page; default: '
                        'none')
    parser.add_argument('--pdf', action='store_true', help='the report also as PDF, beside the HTML file; needs '
                        'Chromium or Google Chrome')


def main(options: argparse.Namespace) -> int:
    """Write the report and print its path. Return exit code 0."""
    from pedestal_results.report import page
    report = page.write(options.bag, options.output, options.png, options.beam, options.author, options.pdf)
    print(report)
    if options.pdf:
        print(report.with_suffix('.pdf'))
    return 0
