"""the state of a running antenna

Angles, rates, errors, mode and reason, receiver, drive and what is not well; exit code 0 where all is well, 1 where a
node says otherwise or none answers.
"""
from pedestal.verbs import arguments


def add_arguments(parser):
    """Where to write it, how long to listen."""
    from pedestal_analysis import console
    console.add_json(parser)
    arguments.add_remote(parser, commands=False)


def main(options):
    """Listen for as long as it takes to hear the control unit, then print."""
    import json

    from pedestal_operator import state
    with arguments.remote(options) as spun:
        spun.wait_for_node(options.timeout)
        name = spun.remote.beam + 'acu'
        spun.until(lambda: spun.remote.present(name) and spun.remote.present('joint_states'), options.timeout)
        rows, alarms = state.rows(spun.remote), state.alarms(spun.remote)
    if options.json:
        table = [{'case': row.group, 'metric': row.name, 'value': row.value, 'unit': row.unit} for row in rows]
        table += [{'case': 'alarm', 'metric': node, 'value': text, 'unit': ''} for node, text in alarms]
        options.json.write_text(json.dumps({'name': 'status', 'rows': table}, indent=1) + '\n')
    for row in rows:
        print(f'{row.group:10} {row.name:22} {row.text:>14} {row.unit}'.rstrip())
    for node, text in alarms:
        print(f'alarm      {node}: {text}')
    return 1 if alarms else 0
