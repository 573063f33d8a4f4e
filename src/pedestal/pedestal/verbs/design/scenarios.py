"""list the scenarios"""
from pedestal_analysis import console


def add_arguments(parser):
    """The verb has none."""


def main(_options):
    """Print name and title of every scenario."""
    from pedestal_bringup.scenario import scenario
    console.show_list(scenario.available().items())
    return 0
