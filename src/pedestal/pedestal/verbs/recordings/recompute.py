"""feed recorded inputs to a node again and compare its outputs

Feeds the recorded inputs of a node to its step function and compares the new outputs with the recorded outputs. It
compares count and order of the messages, then every field. Exit code 1 if a field differs by more than its tolerance,
or if the node did nothing in the recording (never locked, never in autotrack, never moved).

A lockstep recording is recomputed exactly: the same version on the same machine gives the same bits. In a realtime
recording, a step of the recomputation gets all messages that were sent before the next step began. In the run, a
message in transit at that moment was used one step later, so small differences are normal.

Commands are taken from the recorded replies and repeated at their steps. In a bag without replies, a change of
acu/mode or adu/state that no recorded input explains is repeated as a request. The report states the number of the
repeated commands. Changes of parameters during the run are not recorded. Diagnostics are not recomputed.

With --param the verb compares old with new results, and a difference is no failure. Because the recorded antenna does
not follow the recomputed command, only two results are compared: the estimate against the recorded truth (error,
noise, lag), and the noise of the command. The effect of a parameter on the pointing needs a new run.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments
from pedestal_common.parameters import option_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add bag, beam, nodes, changed parameters, tolerances, output."""
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    arguments.add_beam(parser)
    parser.add_argument('--node', action='append', default=[], metavar='NODE',
                        help='node to recompute: acu, adu, tracking_receiver, ins or ship_motion; may be repeated; '
                        'default: every node')
    parser.add_argument('--param', action='append', default=[], metavar='[NODE.]KEY=VALUE',
                        help='parameter and its new value, for a comparison of old and new; may be repeated')
    parser.add_argument('--params-file', type=pathlib.Path, metavar='FILE',
                        help='scenario or parameter file of the recorded nodes, for a bag without parameters')
    parser.add_argument('--pacing', choices=('lockstep', 'realtime'),
                        help='pacing of the run, which determines the inputs of each step; default: pacing in the '
                        'bag, else realtime')
    parser.add_argument('--absolute', type=float, metavar='X', help='absolute tolerance of every field, in its unit; '
                        'default: tolerance of the field (docs/graph.md, Recomputing)')
    parser.add_argument('--relative', type=float, metavar='X', help='additional tolerance relative to the recorded '
                        'value; default: 1e-9')
    parser.add_argument('--ignore', action='append', default=[], metavar='PATTERN',
                        help="topics or topic.field not to compare, for example 'acu/reference*'; may be repeated")
    parser.add_argument('--allow-idle', action='store_true', help='accept a node that did nothing in the recording '
                        '(never locked, never in autotrack, never moved)')
    console.add_json(parser)
    console.add_explain(parser)
    parser.add_argument('--iq', type=pathlib.Path, metavar='FILE', help='.sigmf-meta file of the I/Q samples of this '
                        'run: compare the angle errors that the monopulse receiver makes of them, byte by byte')
    parser.add_argument('--output', type=pathlib.Path, metavar='BAG',
                        help='new bag: the recording with recomputed outputs in place of the recorded outputs')


def main(options: argparse.Namespace) -> int:
    """Recompute and print the comparison. Return the exit code, 1 for a failed comparison."""
    console.check_json(options.json)
    if options.iq is not None:
        for name in ('node', 'param', 'params_file', 'pacing', 'absolute', 'relative', 'ignore', 'allow_idle',
                     'explain', 'output'):
            if getattr(options, name):
                raise ValueError(f'{option_of(name)}: has no effect with --iq')
        from pedestal_workbench.again import iq
        lines, rows, well = iq.main(options)
        print('\n'.join(lines))
        console.write_json(options.json, {'name': 'recompute', 'rows': rows})
        return 0 if well else 1
    from pedestal_workbench.again import recompute_report
    lines, rows, well = recompute_report.main(options)
    print('\n'.join(lines))
    if options.explain:
        from pedestal_workbench.again import what_if
        console.explain(what_if.COMPARISON_RESULTS, {line.split()[0] for line in lines if line})
    console.write_json(options.json, {'name': 'recompute', 'rows': rows})
    return 0 if well else 1
