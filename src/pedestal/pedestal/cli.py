"""Command line `pedestal`: the parser of the arguments, and the call of the verb that the user names. A verb is a row
of VERBS, and a row of VERBS in a module of the package `verbs`. Only the module of the named verb is imported."""
from pedestal import stop  # first, because a signal during the imports below must end the process with its message

# isort: split
import argparse
import contextlib
import importlib
import logging
import os
import re
import shlex
import sys
import typing
from collections.abc import Container, Sequence

from pedestal.console import EXIT_ERROR, EXIT_WRONG_COMMAND, STDOUT_PATH
from pedestal_common.parameters import did_you_mean

if typing.TYPE_CHECKING:
    from pedestal.verbs.arguments import Verb

VERBS = {
    'run': ('run', 'run a scenario as separate nodes and record it'),
    'scenarios': ('design', 'list the scenarios that come with this package'),
    'samples': ('design', 'write sample files: flight, ship, satellites, an antenna, specifications of acceptance'),
    'new': ('design', 'write a scenario of your own antenna from the numbers of its data sheet'),
    'parameters': ('design', 'list the parameters of a node: default, range, unit, meaning'),
    'status': ('operate', 'print the state of a running antenna'),
    'mode': ('operate', 'set the mode of a running antenna control unit (ACU)'),
    'stop': ('operate', 'stop both axes of a running antenna and hold them'),
    'drive': ('operate', 'enable, disable, stop or reset the drive of a running antenna'),
    'ask': ('operate', 'send a command to a running node'),
    'operate': ('operate', 'operate a running antenna by hand on this terminal'),
    'station': ('station', 'take the passes of a plan on a running antenna, one after another'),
    'acceptance': ('acceptance', 'test an antenna against a specification, and write the report of its acceptance'),
    'live': ('operate', 'show a running graph in Foxglove or Lichtblick'),
    'program': ('operate', 'send a table of times and angles (program track) of a scenario to a running ACU'),
    'plan': ('plan', 'plan a night of passes: which satellites the antenna tracks, when, and what it will lose'),
    'simulate': ('simulate', 'simulate equipment as a program of its own, to rehearse with'),
    'verify': ('recordings', 'prove that a recording is complete up to the planned end of its run'),
    'recover': ('recordings', 'make a readable bag from the undamaged part of a bag'),
    'rerun': ('recordings', 'repeat a recorded run and compare the two recordings'),
    'report': ('recordings', 'write a recording as one HTML file with its figures'),
    'study': ('design', 'repeat the experiments of the source papers and compare the numbers'),
    'trials': ('trials', 'run a scenario many times with varied parameters, and print statistics and the worst '
               'trials'),
    'export': ('recordings', 'write a recording as one table per topic, CSV or Parquet, or its tracking data as a '
               'CCSDS TDM'),
    'recompute': ('recordings', 'feed recorded inputs to a node again and compare its outputs'),
    'tune': ('design', 'tune a filter, the feed-forward, or the loops of your own plant'),
    'filter': ('design', 'filter measured angles of a file: angles, rates, and how sure both are'),
    'calibrate': ('calibrate', 'calibrate an antenna from measurements: each step is a verb of its own'),
    'replay': ('recordings', 'publish a recording into a running graph'),
    'bench': ('design', 'measure the speed of this machine: nodes in lockstep, compiled control laws, recordings'),
}
"""{verb: (module of `verbs` that holds it, first line of its help)}, in the order of the help."""

EXIT_CLOSED_PIPE = 141  # 128 + number of SIGPIPE, the convention of shells
COMPLETION_VARIABLE = '_ARGCOMPLETE'  # environment variable of a shell that completes a command line
WRONG_ARGUMENTS = ValueError, FileNotFoundError, FileExistsError, NotADirectoryError
DATA_ERROR_NAMES = 'BagError', 'CalibrationError', 'OrderError', 'StreamError'
"""Names of the errors of recorded data, which are no wrong argument. They are names, because an import of the classes
would make every verb slow."""
NEGATIVE_NUMBER_PATTERN = re.compile(r'-\.?\d')  # beginning of an argument that is a negative number


def found(name: str) -> 'Verb':
    """Return the verb of a name. This imports its module, and no other module of `verbs`."""
    verb: Verb = importlib.import_module(f'pedestal.verbs.{VERBS[name][0]}').VERBS[name]
    return verb


def main(args: Sequence[str] | None = None) -> int:
    """Run a verb; without any argument print the help. Return its exit code: 0; 1 with a line on stderr for an error;
    2 for a wrong argument; 130 after a stop; 141 without a word if the reader of its output has ended."""
    try:
        try:
            return _run(sys.argv[1:] if args is None else args)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the pipe, such as `head`, has closed it. From here on the output goes to the null device. This
        # avoids a second error when Python writes its buffers at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_CLOSED_PIPE


def _complete() -> None:
    """Answer a shell that completes a command line (docs/reference/commands.md), and end the process."""
    import argcomplete
    words = os.environ['COMP_LINE'][:int(os.environ['COMP_POINT'])].split()[1:]
    argcomplete.autocomplete(_parser([word for word in words if word in VERBS][:1]))


def _run(given: Sequence[str]) -> int:
    """Run the verb of a command line, and return its exit code."""
    if COMPLETION_VARIABLE in os.environ:
        _complete()
    named = next((word for word in given if word in VERBS), None)
    parser = _parser(() if named is None else (named,))
    if not given:
        parser.print_help()
        return 0
    if given[0][:1] not in ('-', '') and given[0] not in VERBS:
        parser.error(f"no verb '{given[0]}':{did_you_mean(given[0], VERBS)} pedestal --help lists the verbs")
    options = parser.parse_args(given)
    options.command = shlex.join(('pedestal', *given))
    stop.interrupt_on_stop()
    logging.getLogger('matplotlib').setLevel(logging.ERROR)     # it warns of a home that cannot be written
    json_on_stdout = getattr(options, 'json', None) == STDOUT_PATH
    try:
        with contextlib.redirect_stdout(sys.stderr) if json_on_stdout else contextlib.nullcontext():
            return int(options.main(options))
    except BrokenPipeError:
        raise
    except (ValueError, RuntimeError, OSError) as error:
        print(f'pedestal: error: {error}', file=sys.stderr)
        wrong = isinstance(error, WRONG_ARGUMENTS) and type(error).__name__ not in DATA_ERROR_NAMES
        return EXIT_WRONG_COMMAND if wrong else EXIT_ERROR
    except KeyboardInterrupt:
        print(stop.STOP_MESSAGE, file=sys.stderr)
        return stop.STOP_EXIT_CODE
    finally:
        stop.ignore_at_exit()


class Parser(argparse.ArgumentParser):
    """Parser of options whose values may be any negative number. The parser of argparse reads -1 and -0.5 as values,
    but -1e-2 and -33.9,18.4,10 as unknown options."""

    def parse_known_args(  # type: ignore[override]  # overloads of argparse accept other namespaces
            self, args: Sequence[str] | None = None,
            namespace: argparse.Namespace | None = None) -> tuple[argparse.Namespace, list[str]]:
        """Return (namespace, unknown arguments), with each negative number joined to the option before it."""
        joined: list[str] = []
        for arg in sys.argv[1:] if args is None else args:
            option = bool(joined) and joined[-1].startswith('--') and len(joined[-1]) > 2 and '=' not in joined[-1]
            if option and NEGATIVE_NUMBER_PATTERN.match(arg):
                joined[-1] += f'={arg}'
            else:
                joined.append(arg)
        if self._subparsers is None:
            self._check_options(joined)
        return super().parse_known_args(joined, namespace)

    def _check_options(self, args: Sequence[str]) -> None:
        """End with the usage and the nearest option if this parser lacks an option. The parser of argparse would first
        miss other arguments, and then print the usage of the whole command line."""
        known = self._option_string_actions
        for arg in args[:args.index('--') if '--' in args else None]:
            name = arg.partition('=')[0]
            if name.startswith('--') and not any(option.startswith(name) for option in known):
                near = did_you_mean(name, known)
                self.error(f'unknown option {name}{f";{near}" if near else ""}')

    def parse_args(  # type: ignore[override]  # overloads of argparse accept other namespaces
            self, args: Sequence[str] | None = None,
            namespace: argparse.Namespace | None = None) -> argparse.Namespace:
        """Return the namespace. Arguments NAME=VALUE of a command may also stand behind its options, where the parser
        of argparse does not accept them."""
        namespace, unknown = self.parse_known_args(args, namespace)
        more = [word for word in unknown if '=' in word and not word.startswith('-')]
        if more and hasattr(namespace, 'given'):
            namespace.given = [*namespace.given, *more]
            unknown = [word for word in unknown if word not in more]
        if unknown:
            getattr(namespace, 'parser', self).error(f'unexpected argument {" ".join(unknown)}')
        return namespace


class _Version(argparse.Action):
    """Option --version. It looks the version up only when it is given, because the look-up is slow."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        import importlib.metadata
        print(f'pedestal {importlib.metadata.version("pedestal")}')
        parser.exit()


def _parser(named: Container[str] = VERBS) -> argparse.ArgumentParser:
    """Return the parser of the command line. Only the verbs in `named` get their arguments, which import their
    modules."""
    parser: argparse.ArgumentParser = Parser(
        prog='pedestal', description='Run, record and analyse the control system of a tracking antenna.')
    parser.add_argument('--version', action=_Version, nargs=0, help="show program's version number and exit")
    verbs = parser.add_subparsers(title='verbs', required=True, metavar='VERB')
    for name, (_, line) in VERBS.items():
        if name in named:
            found(name).add_to(verbs, name, line)
        else:
            verbs.add_parser(name, help=line)
    return parser


if __name__ == '__main__':
    sys.exit(main())
