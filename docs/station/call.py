"""Call a service of a running graph, for installations without the command ros2.

    /opt/pedestal/bin/python call.py adu/enable

Prints the reply. Exit code 1: the node refused the request, or no reply arrived within 20 s.
"""
import argparse
import sys

import rclpy
from std_srvs.srv import Trigger

from pedestal_common.node import middleware

TIMEOUT_S = 20.0
"""Longest wait for the node, and for its reply [s]."""


def main():
    """Call the service that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('name', help='name of the service, for example adu/enable')
    name = parser.parse_args().name
    middleware.initialise()
    node = rclpy.create_node('service_call')
    client = node.create_client(Trigger, name)
    if not client.wait_for_service(TIMEOUT_S):
        print(f'no service {name} within {TIMEOUT_S:g} s')
        return 1
    request = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, request, timeout_sec=TIMEOUT_S)
    reply = request.result() if request.done() else Trigger.Response(message='no reply')
    print(reply.message)
    return 0 if reply.success else 1


if __name__ == '__main__':
    sys.exit(main())
