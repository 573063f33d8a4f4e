"""list the scenarios"""


def add_arguments(parser):
    """The verb has none."""


def main(_options):
    """Print name and title of every scenario."""
    from pedestal_bringup.run import scenario
    for name, title in scenario.available().items():
        print(f'{name:14} {title}')
    return 0
