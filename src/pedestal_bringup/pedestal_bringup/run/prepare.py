"""Compiles the laws of one node of a scenario, so that it starts warm: `python -m ... NODE NAME`, the scenario of this
name as YAML on the standard input."""
import sys

from pedestal_bringup.run import scenario
from pedestal_common.compiled import compiled_once


def main():
    node, name = sys.argv[1:]
    unit = scenario.parse(name, sys.stdin.read()).unit(node)
    with compiled_once(unit):
        unit.prepare()


if __name__ == '__main__':
    sys.exit(main())
