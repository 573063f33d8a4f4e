"""Alarms of the control unit: each fault is reported once, with its consequences and the action for the operator.

A step of the control unit calls `conditions`, which uses `detectors` and then runs the `annunciator`.
"""
