"""Command line `pedestal`: the parser of the arguments, and the call of the verb that the user names.

A verb, such as `run`, is a module in `verbs`. The docstring of the module is the help of the verb. Its function
`add_arguments(parser)` adds the arguments, and its function `main(options)` does the work and returns the exit code.
"""
from pedestal import stop  # first, because a signal during the imports below must end the process with its message

# isort: split
import argparse
import contextlib
import importlib
import importlib.metadata
import os
import re
import shlex
import sys
import types
from collections.abc import Sequence

from pedestal_analysis.console import STDOUT_PATH
from pedestal_common.parameters import ParameterError, did_you_mean

VERBS = {'run': 'antenna', 'scenarios': 'design', 'samples': 'design', 'new': 'design', 'parameters': 'design',
         'status': 'antenna', 'mode': 'antenna', 'ask': 'antenna', 'operate': 'antenna', 'live': 'antenna',
         'program': 'antenna', 'simulate': 'simulation', 'verify': 'recordings', 'recover': 'recordings',
         'rerun': 'recordings', 'report': 'recordings', 'study': 'design', 'trials': 'design',
         'export': 'recordings', 'recompute': 'recordings', 'tune': 'design', 'calibrate': 'calibration',
         'replay': 'recordings', 'bench': 'design'}
"""{verb: its package in `verbs`}, in the order of the help."""


NEGATIVE_NUMBER_PATTERN = re.compile(r'-\.?\d')  # beginning of an argument that is a negative number


def module_of(verb: str) -> types.ModuleType:
    """Return the module of a verb."""
    return importlib.import_module(f'pedestal.verbs.{VERBS[verb]}.{verb}')


def main(args: Sequence[str] | None = None) -> int:
    """Run a verb; without any argument print the help.

    Return its exit code: 0; 1 with a line on stderr for an error; 2 for a wrong command line; 130 after a stop.
    """
    given = sys.argv[1:] if args is None else args
    parser = _parser(next((word for word in given if word in VERBS), ''))
    if not given:
        parser.print_help()
        return 0
    if given[0][:1] not in ('-', '') and given[0] not in VERBS:
        parser.error(f"no verb '{given[0]}':{did_you_mean(given[0], VERBS)} pedestal --help lists the verbs")
    options = parser.parse_args(given)
    options.command = shlex.join(('pedestal', *given))
    stop.interrupt_on_stop()
    json_on_stdout = getattr(options, 'json', None) == STDOUT_PATH
    try:
        with contextlib.redirect_stdout(sys.stderr) if json_on_stdout else contextlib.nullcontext():
            code = options.main(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader of the pipe, such as `head`, has closed it. From here on the output goes to the null device. This
        # avoids a second error when Python writes its buffers at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ParameterError, ValueError, RuntimeError, OSError) as error:
        print(f'pedestal: error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(stop.STOP_MESSAGE, file=sys.stderr)
        return stop.STOP_EXIT_CODE
    finally:
        stop.ignore_at_exit()


class Parser(argparse.ArgumentParser):
    """Parser of options whose values may be any negative number.

    The parser of argparse reads -1 and -0.5 as values, but -1e-2 and -33.9,18.4,10 as unknown options.
    """

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
        return super().parse_known_args(joined, namespace)

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
            self.error(f'unrecognized arguments: {" ".join(unknown)}')
        return namespace


def _parser(named: str = '') -> argparse.ArgumentParser:
    """Return the parser of the command line with all verbs. named: the only verb that gets its arguments, because the
    arguments of `run` import the code of a graph; '' for all."""
    parser = Parser(prog='pedestal', description='Run, record and analyse the control system of a tracking antenna.')
    parser.add_argument('--version', action='version', version=f'pedestal {importlib.metadata.version("pedestal")}')
    verbs = parser.add_subparsers(title='verbs', required=True, metavar='VERB')
    for name in VERBS:
        verb = module_of(name)
        description = (verb.__doc__ or '').strip()
        verb_parser = verbs.add_parser(name, help=description.partition('\n\n')[0], description=description,
                                       formatter_class=argparse.RawDescriptionHelpFormatter)
        if named in ('', name):
            verb.add_arguments(verb_parser)
        verb_parser.set_defaults(main=verb.main)
    return parser


if __name__ == '__main__':
    sys.exit(main())
