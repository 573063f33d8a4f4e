"""The command line `pedestal`.

A verb is a module of the room `verbs`: its help is the module's docstring, `add_arguments(parser)` adds its arguments,
and `main(options)` does the work and returns the exit code.
"""
from pedestal import stop

# isort: split
import argparse
import contextlib
import importlib
import os
import re
import shlex
import signal
import sys

from pedestal_analysis.console import STDOUT_PATH
from pedestal_common.parameters import ParameterError

VERBS = {'run': 'antenna', 'scenarios': 'design', 'samples': 'design', 'new': 'design', 'parameters': 'design',
         'status': 'antenna', 'mode': 'antenna', 'ask': 'antenna', 'operate': 'antenna', 'live': 'antenna',
         'program': 'antenna', 'verify': 'recordings', 'recover': 'recordings', 'rerun': 'recordings',
         'report': 'recordings', 'study': 'design', 'trials': 'design', 'export': 'recordings',
         'recompute': 'recordings', 'tune': 'design', 'replay': 'recordings', 'bench': 'design'}
"""{verb: its room of `verbs`} in the order of the help."""


NEGATIVE_NUMBER_PATTERN = re.compile(r'-\.?\d')
"""Beginning of an argument that is a negative number."""


def module_of(verb):
    """Return the module of a verb."""
    return importlib.import_module(f'pedestal.verbs.{VERBS[verb]}.{verb}')


def main(args=None) -> int:
    """Run a verb: exit code 0; 1 with one line on stderr for an error; 2 for a wrong command line; 130 if stopped."""
    options = _parser().parse_args(_joined(sys.argv[1:] if args is None else args))
    options.command = shlex.join(('pedestal', *(sys.argv[1:] if args is None else args)))
    stop.on_stop(signal.default_int_handler)
    alone = getattr(options, 'json', None) == STDOUT_PATH
    try:
        with contextlib.redirect_stdout(sys.stderr) if alone else contextlib.nullcontext():
            code = options.main(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # Who read it, as `head` does, has enough; a second error, at the end of Python, would tell nobody.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ParameterError, ValueError, RuntimeError, OSError) as error:
        print(f'pedestal: error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(stop.STOP_MESSAGE, file=sys.stderr)
        return stop.STOP_EXIT_CODE


def _joined(args: list[str]) -> list[str]:
    """Return arguments with each negative number joined to the option before it, as --az=-1e-2.

    argparse takes only plain negative numbers for values, not -1e-2 or -33.9,18.4,10.
    """
    joined: list[str] = []
    for arg in args:
        option = bool(joined) and joined[-1].startswith('--') and len(joined[-1]) > 2 and '=' not in joined[-1]
        if option and NEGATIVE_NUMBER_PATTERN.match(arg):
            joined[-1] += f'={arg}'
        else:
            joined.append(arg)
    return joined


def _parser():
    parser = argparse.ArgumentParser(prog='pedestal', description='The control system of a tracking antenna: run it, '
                                     'record it, look at it.')
    verbs = parser.add_subparsers(title='verbs', required=True, metavar='VERB')
    for name in VERBS:
        verb = module_of(name)
        summary, _, description = verb.__doc__.partition('\n\n')
        described = verbs.add_parser(name, help=summary, description=description or summary,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
        verb.add_arguments(described)
        described.set_defaults(main=verb.main)
    return parser


if __name__ == '__main__':
    sys.exit(main())
