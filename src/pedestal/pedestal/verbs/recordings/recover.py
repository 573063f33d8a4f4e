"""make a readable bag from the undamaged part of a bag"""
import argparse
import pathlib


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add bag and output folder."""
    parser.add_argument('bag', type=pathlib.Path, help='damaged recording: a folder or an .mcap file')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder; default: BAG-recovered')


def main(options: argparse.Namespace) -> int:
    """Recover the bag and print a summary. Return exit code 0."""
    from pedestal_recording.recover import recover
    print('\n'.join(recover(options.bag, options.output).lines()))
    return 0
