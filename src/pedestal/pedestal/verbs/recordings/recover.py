"""make a readable bag of what is left in a damaged one"""
import pathlib


def add_arguments(parser):
    """Bag and output folder."""
    parser.add_argument('bag', type=pathlib.Path)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='default: beside it, BAG-recovered')


def main(options):
    """Recover the bag and print what was saved."""
    from pedestal_recording.recover import recover
    print('\n'.join(recover(options.bag, options.output).lines()))
    return 0
