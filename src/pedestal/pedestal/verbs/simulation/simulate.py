"""simulate equipment as a program of its own, to rehearse with

Each equipment is a program with its own clock. The nodes of pedestal_hardware connect to it as to the real equipment.
"""
import argparse

from pedestal.verbs import arguments
from pedestal.verbs.simulation import drives, ins, receiver, rotator

EQUIPMENT = {'drives': drives, 'receiver': receiver, 'rotator': rotator, 'ins': ins}
"""{name of an equipment: its module}, in the order of the help."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add a subcommand for each equipment."""
    arguments.add_subcommands(parser, 'equipment', EQUIPMENT)


def main(options: argparse.Namespace) -> int:
    """Simulate an equipment and return the exit code."""
    code: int = options.subcommand(options)
    return code
