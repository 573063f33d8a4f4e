"""print the state of a running antenna

Prints angles, rates, errors, mode and its reason, receiver, drive, and the nodes that report a warning or an error.
Exit code 0: every node reports OK. Exit code 1: no graph runs, or a node is silent or reports a warning or an error.
"""
import argparse

from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add file of the rows and the options of a client."""
    from pedestal import console
    console.add_json(parser)
    arguments.add_remote(parser, commands=False)


def main(options: argparse.Namespace) -> int:
    """Wait for the state of the control unit and print it. Return the exit code."""
    from pedestal import console
    from pedestal_operator import state
    console.check_json(options.json)
    with arguments.remote(options) as session:
        session.wait_for_node(options.timeout)
        name = session.remote.beam + 'acu'
        session.until(lambda: session.remote.present(name) and session.remote.present('joint_states'),
                      options.timeout)
        rows, alarms = state.rows(session.remote), state.node_reports(session.remote)
    table = [{'case': row.group, 'metric': row.name, 'value': row.json, 'unit': row.unit} for row in rows]
    table += [{'case': 'alarm', 'metric': node, 'value': text, 'unit': ''} for node, text in alarms]
    console.write_json(options.json, {'name': 'status', 'rows': table})
    for row in rows:
        print(f'{row.group:10} {row.name:22} {row.text:>14} {row.unit}'.rstrip())
    for node, text in alarms:
        print(f'alarm      {node}: {text}')
    return 1 if alarms else 0
