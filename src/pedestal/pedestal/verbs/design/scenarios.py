"""list the scenarios that come with this package"""
import argparse

from pedestal import console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the verb has no arguments."""


def main(_options: argparse.Namespace) -> int:
    """Print name and title of every scenario. Return exit code 0."""
    from pedestal_bringup.scenario import files
    console.show_list(files.available().items())
    return 0
