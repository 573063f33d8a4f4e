"""Send the program track of a scenario beside its nodes: python -m pedestal_bringup.graph.send_program SCENARIO.

pedestal.launch.py starts this module; users call `pedestal program`. watch.send_program does the work.
"""
import sys

from pedestal_bringup.graph import watch
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan

if __name__ == '__main__':
    sys.exit(watch.send_program(Plan(scenario.load(sys.argv[1])), ros_arguments=sys.argv[2:]))
