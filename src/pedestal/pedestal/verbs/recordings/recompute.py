"""feed recorded inputs to a node again and compare its outputs

Feeds the recorded inputs of a node to its step function and compares its outputs with the recorded ones: count and
order of the messages first, then every field. Exit code 1 when something differs beyond its tolerance, or when the
recording never exercised the node (never locked, never in autotrack, never moved).

Exact for a lockstep recording: the same version on the same machine gives the same bits. In a realtime recording a
step gets the messages sent before the next one began, which the node had too, except for those still on their way.
Services are not recorded: a change of acu/mode or adu/state that the node would not make by itself is requested at
that step, and counted. Parameters that were changed while running are not recorded. Diagnostics are not recomputed.

With --param it does not fail but compares old with new. The recorded antenna does not move with the recomputed
command, so the comparison covers the estimate against the recorded truth (error, noise, lag) and the noise of the
command; the effect of a parameter on the pointing needs a new run."""
import pathlib

from pedestal.verbs import arguments
from pedestal_analysis import console


def add_arguments(parser):
    """Bag, beam, nodes, changed parameters, tolerances, output."""
    parser.add_argument('bag', type=pathlib.Path)
    arguments.add_beam(parser)
    parser.add_argument('--node', action='append', default=[], metavar='NODE',
                        help='acu, adu, tracking_receiver, ins or ship_motion; may be repeated; default: every node')
    parser.add_argument('--param', action='append', default=[], metavar='[NODE.]KEY=VALUE',
                        help='change a parameter and report old against new; may be repeated')
    parser.add_argument('--params-file', type=pathlib.Path, metavar='FILE',
                        help='scenario or parameter file of the recorded nodes, where the bag does not say')
    parser.add_argument('--pacing', choices=('lockstep', 'realtime'),
                        help='how inputs belong to steps; default: as the bag says, else realtime')
    parser.add_argument('--absolute', type=float, metavar='X', help='tolerance of every field, in its unit; default: '
                        'by kind of field')
    parser.add_argument('--relative', type=float, metavar='X', help='and relative to the recorded value; default: '
                        '1e-9')
    parser.add_argument('--ignore', action='append', default=[], metavar='PATTERN',
                        help="topics or topic.field not to compare, for example 'acu/reference*'; may be repeated")
    parser.add_argument('--allow-idle', action='store_true', help='compare also where the node was never exercised')
    parser.add_argument('--live', action='store_true', help='feed the real node process, in lockstep over DDS')
    console.add_json(parser)
    console.add_explain(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='BAG',
                        help='write the recording again, with the recomputed outputs in place of the recorded')


def main(options):
    """Recompute and print the comparison; exit code 1 where it fails."""
    from pedestal_analysis.reprocess import recompute_report
    lines, rows, well = recompute_report.main(options)
    print('\n'.join(lines))
    if options.explain:
        from pedestal_analysis.reprocess import what_if
        console.explain(what_if.COMPARISON_RESULTS, {line.split()[0] for line in lines if line})
    console.write_json(options.json, {'name': 'recompute', 'rows': rows})
    return 0 if well else 1
