"""list the parameters of a node: default, range, unit, meaning"""
from pedestal_analysis import console


def add_arguments(parser):
    """The node."""
    parser.add_argument('node', help='acu, adu, beam_steering, tracking_receiver, ship_motion, ins, recorder ...')


def main(options):
    """Print a row for each parameter of the node, and for those of the graph that every node has."""
    from pedestal_bringup.scenario import scenario
    from pedestal_common import parameters
    from pedestal_common.graph.graph_parameters import GraphParameters
    rows = []
    for prefix, parameters_type in (('', scenario.parameters_of(options.node)), ('graph.', GraphParameters)):
        values = parameters.defaults(parameters_type)
        rows += [(prefix + name, *_columns(field.metadata, values[name]))
                 for name, field in parameters.flatten(parameters_type)]
    console.show_list(rows)
    return 0


def _columns(meta, value):
    allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ' | '.join(meta.get('options', ()))
    unit = f' [{meta["unit"]}]' if meta.get('unit') else ''
    return f'{value:g}' if isinstance(value, float) else str(value), allowed, f'{meta["doc"]}{unit}'
