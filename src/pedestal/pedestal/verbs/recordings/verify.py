"""prove that a recording is complete up to the planned end of its run

Exit code 1, with a list of the gaps, for an incomplete recording.
"""
import argparse
import pathlib


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the bag."""
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')


def main(options: argparse.Namespace) -> int:
    """Print the check. Return the exit code, 1 for an incomplete bag."""
    from pedestal_recording.bag import load
    from pedestal_recording.verify import verify
    check = verify(load(options.bag))
    print('\n'.join(check.lines()))
    return 0 if check.finished else 1
