"""Program of the launch file pedestal.launch.py: sends the program track of a scenario to its running nodes. Users
call `pedestal program` instead."""
import sys

from pedestal_bringup.graph import watch
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan

if __name__ == '__main__':
    sys.exit(watch.send_program(Plan(scenario.load(sys.argv[1])), ros_arguments=sys.argv[2:]))
