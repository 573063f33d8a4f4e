"""list the parameters of a node: default, range, unit, meaning"""


def add_arguments(parser):
    """The node."""
    parser.add_argument('node', help='acu, adu, beam_steering, tracking_receiver, ship_motion, ins, recorder ...')


def main(options):
    """Print one line for each parameter of the node."""
    from pedestal_bringup.run import scenario
    from pedestal_common import parameters
    parameters_type = scenario.parameters_of(options.node)
    values = parameters.defaults(parameters_type)
    for name, field in parameters.flatten(parameters_type):
        meta = field.metadata
        allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ' | '.join(meta.get('options', ()))
        unit = f' [{meta["unit"]}]' if meta.get('unit') else ''
        value = f'{values[name]:g}' if isinstance(values[name], float) else str(values[name])
        print(f'{name:42} {value:>14}  {allowed:24} {meta["doc"]}{unit}')
    return 0
