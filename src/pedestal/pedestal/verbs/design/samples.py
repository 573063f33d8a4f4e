"""write sample files: a flight log, a ship log, a satellite, an antenna

Writes flight.csv, ship.csv, iss.tle and my_antenna.yaml. If one of these files exists, nothing is written.
"""
import argparse
import pathlib

from pedestal import console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the output folder."""
    parser.add_argument('folder', nargs='?', type=pathlib.Path, default=pathlib.Path(), metavar='DIR',
                        help='output folder; default: the current folder')


def main(options: argparse.Namespace) -> int:
    """Write the files and list them. Return exit code 0. Raises FileExistsError for an existing file."""
    from pedestal import samples
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in samples.SAMPLE_FILES:
        if (options.folder / name).exists():
            raise FileExistsError(f'{options.folder / name} already exists and is not overwritten')
    for name, text in samples.SAMPLE_FILES.items():
        (options.folder / name).write_text(text())
    console.show_list((str(options.folder / name), samples.FILE_DESCRIPTIONS[name]) for name in samples.SAMPLE_FILES)
    return 0
