"""Verb `acceptance`: an antenna is measured against a specification, and its report is written."""
import argparse
import contextlib
import datetime
import inspect
import math
import pathlib
import sys
import typing
from collections.abc import Sequence

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

if typing.TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from pedestal_workbench.acceptance.exercise import Exercise, Performer
    from pedestal_workbench.acceptance.sequence import Kept
    from pedestal_workbench.acceptance.specification import Specification


def _add_acceptance(parser: argparse.ArgumentParser) -> None:
    """Makes the exercise of each requirement of a specification on the running graph, measures it, judges it, and
    writes report.html, report.pdf, report.json and report.xml (JUnit). `pedestal samples` writes a specification that
    explains its keys. What the antenna will do is printed and confirmed first. An alarm, or an antenna outside of the
    stated envelope, ends the exercise in a stop and fails its requirement. The sequence then ends on a running graph,
    and goes on with --scenario. An operator ends it in a stop. The same command continues it.

        pedestal acceptance acceptance.yaml --tester "A. Smith"
        pedestal acceptance acceptance.yaml --scenario station_real --yes --json -

    Exit codes:
    """
    parser.add_argument('specification', type=pathlib.Path, metavar='SPECIFICATION.yaml', help='file with the '
                        'requirements')
    action = parser.add_argument('--scenario', metavar='NAME', help='scenario (name or .yaml file) whose simulated '
                                 'graph is started and tested; default: the running graph')
    vars(action)['completer'] = arguments.scenarios_and_files
    parser.add_argument('--closed-loop', action='store_true', help='scenario in one process, in memory, without '
                        'nodes and without recordings; needs --scenario')
    parser.add_argument('--seed', type=int, default=1, metavar='N', help='first seed of the noises of a scenario; '
                        'default: 1')
    arguments.add_param(parser)
    arguments.add_params_file(parser)
    parser.add_argument('--yes', action='store_true', help='confirmation of the motions, for use without a terminal')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='folder of the report and the recordings; '
                        'default: acceptance- and the name of the specification')
    parser.add_argument('--tester', default='', metavar='NAME', help='name of the person who tests, for the report; '
                        'default: that of the specification')
    console.add_json(parser)


_add_acceptance.__doc__ = f"""{inspect.getdoc(_add_acceptance)}
  0: all requirements are passed.
  {console.EXIT_ERROR}: the sequence did not come to its end; the last line states the reason.
  {console.EXIT_WRONG_COMMAND}: the specification cannot be used, or the motions were not confirmed. Nothing has moved.
  {console.EXIT_FAILED_RUN}: a requirement is failed or inconclusive.
  {console.EXIT_STOPPED}: an operator stopped the sequence."""


def _acceptance(options: argparse.Namespace) -> int:
    from pedestal_workbench.acceptance import document, sequence, specification
    from pedestal_workbench.acceptance.exercise import StoppedError
    if not options.scenario:
        arguments.refuse_given(options, ('closed_loop', 'param', 'params_file'), 'needs --scenario')
    console.check_json(options.json)
    spec = specification.read(options.specification, options.tester)
    folder = options.output or pathlib.Path(f'acceptance-{options.specification.stem}')
    if not folder.is_dir() and (folder.exists() or not folder.parent.is_dir()):
        raise ValueError(f'--output {folder}: must be a directory, or a new one in a directory that exists')
    code = 0
    opened, source = _performer(options, folder)
    with opened as performer:
        exercises = spec.exercises(performer)
        _confirm(options.yes, spec, exercises)
        with console.progress_of_share() as progress:
            def report(kept: 'Kept') -> None:
                place = [requirement.name for requirement in spec.requirements].index(kept.name)
                progress((place + 1) / len(spec.requirements), kept.name)
                print(document.line(spec.requirements[place], kept))
            try:
                sequence.run(spec, exercises, performer, folder, options.seed, report)
            except StoppedError:
                code = console.EXIT_ERROR
            except KeyboardInterrupt:
                code = console.EXIT_STOPPED
    found = document.Acceptance(spec, *sequence.read(folder)[:2], performer.antenna, source, options.command,
                                datetime.datetime.now(datetime.timezone.utc))
    print(*document.write(found, folder), sep='\n')
    console.write_json(options.json, document.json_content(found))
    print(found.verdict)
    if found.stopped:
        print(f'pedestal: {found.stopped}; the same command continues the sequence', file=sys.stderr)
    return code or (0 if found.passed else console.EXIT_FAILED_RUN)


def _performer(options: argparse.Namespace, folder: pathlib.Path) -> 'tuple[AbstractContextManager[Performer], str]':
    """Return the performer of the options as a context, and what it tests in words."""
    if not options.scenario:
        from pedestal_workbench.acceptance.running_graph import RunningGraph
        return RunningGraph(folder), 'the running graph'
    variant, source = arguments.variant(options), f'simulation: scenario {options.scenario}'
    if options.closed_loop:
        from pedestal_workbench.acceptance.in_loop import InLoop
        return contextlib.nullcontext(InLoop(variant)), f'{source} in the closed loop, seed {options.seed}'
    from pedestal_workbench.acceptance.own_graph import OwnGraph
    return OwnGraph(variant, folder), f'{source} as nodes, seed {options.seed}'


def _confirm(yes: bool, spec: 'Specification', exercises: 'Sequence[Exercise]') -> None:
    """Print what the antenna will do. yes: it is confirmed. Raises ValueError without a confirmation."""
    from pedestal_common.text_files.text_table import Cell, TextTable
    rows: list[list[Cell]] = [
        [requirement.name, *(f'{span.low:.4g} to {span.high:.4g}' for span in exercise.envelope),
         *(span.rate for span in exercise.envelope), exercise.duration, requirement.repetitions]
        for requirement, exercise in zip(spec.requirements, exercises)]
    heads = ('requirement', ('azimuth [deg]', '>'), ('elevation [deg]', '>'), ('azimuth rate [deg/s]', '>.3g'),
             ('elevation rate [deg/s]', '>.3g'), ('time [s]', '>.0f'), ('repetitions', '>.0f'))
    whole = sum(exercise.duration * requirement.repetitions
                for requirement, exercise in zip(spec.requirements, exercises))
    print('The antenna will move within:', *TextTable(heads, rows).lines(), 'Time of all exercises: at most '
          f'{math.ceil(whole / 60.0)} min, without the motions to their begins.', sep='\n')
    if yes:
        return
    if not sys.stdin.isatty():
        raise ValueError('--yes: must be given without a terminal, to confirm the motions above')
    print('Move the antenna as stated? yes or no: ', end='', flush=True)
    if sys.stdin.readline().strip().lower() != 'yes':
        raise ValueError('the motions were not confirmed; nothing has moved')


VERBS = {'acceptance': Verb(_add_acceptance, _acceptance)}
