"""write files to begin with: a flight log, a ship log, a satellite, an antenna

Writes flight.csv, ship.csv, iss.tle and my_antenna.yaml. A file that is there already is not touched."""
import pathlib

from pedestal_analysis import console


def add_arguments(parser):
    """Where to."""
    parser.add_argument('folder', nargs='?', type=pathlib.Path, default=pathlib.Path(), metavar='DIR',
                        help='default: the current folder')


def main(options):
    """Write the files and list them. Raises FileExistsError where one is there."""
    from pedestal import samples
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in samples.SAMPLE_FILES:
        if (options.folder / name).exists():
            raise FileExistsError(f'{options.folder / name} is there already and is not overwritten')
    for name, text in samples.SAMPLE_FILES.items():
        (options.folder / name).write_text(text())
    console.show_list((str(options.folder / name),
                       ' '.join(samples.FILE_DESCRIPTIONS[name].split())) for name in samples.SAMPLE_FILES)
    return 0
