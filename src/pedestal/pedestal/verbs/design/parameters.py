"""list the parameters of a node: default, range, unit, meaning"""
import argparse
from collections.abc import Mapping

from pedestal import console
from pedestal_common.quantities import Json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the node."""
    parser.add_argument('node',
                        help='name of the node: acu, adu, beam_steering (drive of an array), tracking_receiver, '
                        'ship_motion, ins, recorder; or scenario')


def main(options: argparse.Namespace) -> int:
    """Print a row for each parameter of the node and of the graph. Return exit code 0."""
    from pedestal_bringup.scenario.sections import parameters_of
    from pedestal_common import parameters
    from pedestal_common.graph.graph_parameters import GraphParameters
    rows = []
    for prefix, parameters_type in (('', parameters_of(options.node)), ('graph.', GraphParameters)):
        values = parameters.defaults(parameters_type)
        rows += [(prefix + name, *_columns(field.metadata, values[name]))
                 for name, field in parameters.flatten(parameters_type)]
    console.show_list(rows)
    return 0


def _columns(meta: Mapping[str, Json], value: object) -> tuple[str, str, str]:
    """Return default, range or options, and meaning with unit of a parameter, as texts."""
    allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ' | '.join(meta.get('options', ()))
    unit = f' [{meta["unit"]}]' if meta.get('unit') else ''
    return f'{value:g}' if isinstance(value, float) else str(value), allowed, f'{meta["doc"]}{unit}'
