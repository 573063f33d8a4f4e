"""Files that each step of `pedestal calibrate` writes: a parameter file and a page."""
import dataclasses
import pathlib
import shlex
from collections.abc import Callable, Iterable, Mapping

from pedestal_common.graph import nodes
from pedestal_common.parameters import check_each
from pedestal_common.quantities import Json
from pedestal_common.text_files import parameter_file


@dataclasses.dataclass(frozen=True)
class ResultFiles:
    """Files that a step writes."""
    output: pathlib.Path | None     # parameter file
    report: pathlib.Path | None     # HTML page
    command: str                    # whole command line, for the heads of the files


def write(files: ResultFiles, printed: Iterable[str], sections: Mapping[str, Mapping[str, Json]],
          page: Callable[[], str], iq: bool = False, verified: bool = True) -> list[str]:
    """Write the files of a step. Return a line for each of them.

    printed: lines that the step prints, for the head of the parameter file; sections: {node: {parameter: value}};
    page(): HTML text of the page; iq: True for the parameters of a receiver of I/Q samples. A result that is not
    `verified` gets no parameter file, because it must not be used. Raises ParameterError for a value out of its range.
    """
    said = []
    if files.output and not verified:
        said.append(f'not written: {files.output}, because the result is not verified')
    elif files.output:
        for node, values in sections.items():
            check_each(nodes.row(node, iq=iq).parameters_type(), values)
        parameter_file.write_new(files.output, sections, [*parameter_file.origin(files.command), *printed])
        said.append(f'written: {files.output}  (pedestal run SCENARIO '
                    f'--params-file {shlex.quote(str(files.output))})')
    if files.report:
        files.report.write_text(page(), encoding='utf-8')
        said.append(f'page: {files.report}')
    return said
