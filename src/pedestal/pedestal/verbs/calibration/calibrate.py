"""calibrate an antenna from measurements: each step is a verb of its own

The step `pointing` fits the pointing model of the control unit to measured offsets. The step `receiver` measures
slopes and cross-talk of the tracking receiver. The step `drive` identifies friction, inertia, lash and structure.
The step `sensitivity` measures beamwidth, squint and G/T.
"""
import argparse

from pedestal.verbs import arguments
from pedestal.verbs.calibration import drive, pointing, receiver, sensitivity

STEPS = {'pointing': pointing, 'receiver': receiver, 'drive': drive, 'sensitivity': sensitivity}
"""{name of a step: its module}, in the order of the help."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add a subcommand for each step."""
    arguments.add_subcommands(parser, 'step', STEPS)


def main(options: argparse.Namespace) -> int:
    """Carry out a step and return its exit code."""
    code: int = options.subcommand(options)
    return code
