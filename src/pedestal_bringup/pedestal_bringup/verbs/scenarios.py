"""list the scenarios"""


def add_arguments(parser):
    """None."""


def main(_options):
    from pedestal_bringup.run import scenario
    for name, title in scenario.available().items():
        print(f'{name:14} {title}')
    return 0
