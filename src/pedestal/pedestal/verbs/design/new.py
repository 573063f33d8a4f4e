"""write a scenario of your own antenna from the numbers of its data sheet

All other values of the antenna are scaled from the antenna of the scenario leo_pass. A comment in the file explains
each value. `pedestal tune FILE --loops` then tunes the loops and measures their margins.
"""
import argparse
import pathlib
import shlex

from pedestal_common import parameters
from pedestal_common.parameters import option_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the file and the numbers of the data sheet."""
    from pedestal_workbench.tuning.data_sheet_format import DataSheet
    parser.add_argument('file', type=pathlib.Path, metavar='FILE.yaml', help='new scenario file')
    for name, field in parameters.flatten(DataSheet):
        unit = field.metadata.get('unit')
        allowed = ', '.join(field.metadata.get('options', ()))
        described = f'{field.metadata["doc"]}{f": {allowed}" if allowed else ""}; default: {field.default}'
        parser.add_argument(option_of(name), type=field.type, default=field.default,
                            metavar=unit.upper().replace(' ', '') if unit else 'SCENARIO' if allowed else 'RATIO',
                            help=described.replace('%', '%%'))


def main(options: argparse.Namespace) -> int:
    """Write the file. Return exit code 0. Raises ValueError for a wrong value, FileExistsError for an
    existing file."""
    from pedestal_workbench.tuning import antenna_from_data_sheet
    from pedestal_workbench.tuning.data_sheet_format import DataSheet
    if options.file.suffix not in ('.yaml', '.yml'):
        raise ValueError(f'{options.file}: must end in .yaml or .yml')
    if options.file.exists():
        raise FileExistsError(f'{options.file} already exists and is not overwritten')
    try:
        sheet = DataSheet(**{name: getattr(options, name) for name, _ in parameters.flatten(DataSheet)})
    except parameters.ParameterError as error:
        name, equals, rest = str(error).partition(' = ')
        raise ValueError(f'{option_of(name)}{equals}{rest}') from None
    content, remarks = antenna_from_data_sheet.new(sheet, options.file.stem, options.command)
    options.file.write_text(content)
    print(*remarks, sep='\n', end='\n' if remarks else '')
    following = shlex.join(('pedestal', 'tune', str(options.file), '--loops'))
    print(f'written: {options.file}  ({following})')
    return 0
