"""prove that a recording is complete up to the planned end of its run; exit code 1 with the gaps if not"""
import pathlib


def add_arguments(parser):
    """The bag."""
    parser.add_argument('bag', type=pathlib.Path)


def main(options):
    """Print the check; exit code 1 where the bag is not complete."""
    from pedestal_recording.bag import load
    from pedestal_recording.verify import verify
    check = verify(load(options.bag))
    print('\n'.join(check.lines()))
    return 0 if check.finished else 1
