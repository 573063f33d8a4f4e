"""Driver of `pedestal calibrate`: each step prints the lines of its result, and writes a parameter file and a page."""
import abc
import contextlib
import dataclasses
import html
import pathlib
import shlex
from collections.abc import Iterator
from typing import ClassVar

from pedestal_common.graph import nodes
from pedestal_common.parameters import check_each
from pedestal_common.quantities import Json, Row
from pedestal_common.text_files import parameter_file
from pedestal_common.text_files.text_table import TextTable
from pedestal_results.report import elements
from pedestal_results.report.figures import Spec


class CalibrationError(ValueError):
    """Error of measurements that allow no calibration. Its text is one line, without the name of the measurements."""


@contextlib.contextmanager
def named(source: object) -> Iterator[None]:
    """Raise a CalibrationError of the body as a ValueError whose text begins with the name of the source."""
    try:
        yield
    except CalibrationError as error:
        raise ValueError(f'{source}: {error}') from None


@dataclasses.dataclass(frozen=True)
class ResultFiles:
    """Files that a step writes."""
    output: pathlib.Path | None     # parameter file
    report: pathlib.Path | None     # HTML page
    command: str                    # whole command line, for the heads of the files


@dataclasses.dataclass(frozen=True)
class Calibration(abc.ABC):
    """Result of a step of `pedestal calibrate`."""
    STEP: ClassVar[str]     # name of the step, and case of its rows
    FIGURES: ClassVar[tuple[Spec, ...]]     # of the page
    IQ: ClassVar[bool] = False  # True for the parameters of a receiver of I/Q samples

    source: str     # name of the file, of the recordings or of the scenario

    @property
    def verified(self) -> bool:
        """True if the result may be used."""
        return True

    @abc.abstractmethod
    def rows(self) -> list[Row]:
        """Return the rows for --json."""

    @abc.abstractmethod
    def lines(self) -> list[str]:
        """Return the printed lines."""

    @abc.abstractmethod
    def parameters(self) -> dict[str, dict[str, Json]]:
        """Return {node: {name: value}} for the parameter file."""

    def details(self) -> dict[str, Json]:
        """Return the content of the --json file except name, rows and source."""
        return {}

    def tables(self) -> dict[str, TextTable]:
        """Return {heading: table} of the end of the page."""
        return {}

    def content(self) -> dict[str, Json]:
        """Return the content of the --json file."""
        return {'name': f'calibrate {self.STEP}', 'rows': self.rows(), 'source': self.source, **self.details()}

    def page(self, command: str) -> str:
        """Return the HTML page; command: the command line."""
        title = f'{self.STEP.capitalize()} calibration'
        return elements.page(title, [
            f'<h1>{title}: {html.escape(self.source)}</h1>', f'<p class="soft">{html.escape(command)}</p>',
            f'<pre class="wide">{html.escape(chr(10).join(self.lines()))}</pre>',
            *(elements.figure(spec, self) for spec in self.FIGURES),
            *(f'<h2>{html.escape(heading)}</h2>{table.html("n")}' for heading, table in self.tables().items())])

    def write(self, files: ResultFiles) -> list[str]:
        """Write the files and return a line for each of them. Raises ParameterError for a value out of its range. A
        result that is not verified gets no parameter file, because it must not be used."""
        said = []
        if files.output and not self.verified:
            said.append(f'not written: {files.output}, because the result is not verified')
        elif files.output:
            sections = self.parameters()
            for node, values in sections.items():
                check_each(nodes.row(node, iq=self.IQ).parameters_type(), values)
            parameter_file.write_new(files.output, sections, [*parameter_file.origin(files.command), *self.lines()])
            said.append(f'written: {files.output}  (pedestal run SCENARIO '
                        f'--params-file {shlex.quote(str(files.output))})')
        if files.report:
            files.report.write_text(self.page(files.command), encoding='utf-8')
            said.append(f'page: {files.report}')
        return said
