"""Program that sends the program track of a scenario to its running nodes.

The launch file pedestal.launch.py starts it as `python -m pedestal_bringup.graph.send_program SCENARIO`. Users call
`pedestal program` instead. The function watch.send_program does the work.
"""
import sys

from pedestal_bringup.graph import watch
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan

if __name__ == '__main__':
    sys.exit(watch.send_program(Plan(scenario.load(sys.argv[1])), ros_arguments=sys.argv[2:]))
