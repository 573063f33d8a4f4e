"""Alarms of the control unit: each fault is reported once, with its consequences and the action for the operator.

A step of the control unit calls `conditions`, which uses `detectors` and then runs the `annunciator`.

`table`        one row for each alarm: priority, delays, latching, causes, meaning, action
`detectors`    laws that detect faults from the motion of an axis
`conditions`   conditions of all alarms in a step: bits in the order of the table
`machine`      states of one alarm (ANSI/ISA-18.2-2016, section 6.2; IEC 62682)
`annunciator`  state of all alarms: delays, first alarm of a burst, causes, shelving, reset
`report`       message on acu/alarms

`operating.alarm_desk` has the commands of the operator.

Symbols
    y, dy           encoder angle, rate by the motors' encoders                         [rad], [rad/s]
    u               rate command in force                                               [rad/s]
    e               following error: reference minus encoder                            [rad]
    T               torque of an axis on its load, as the drive measures it             [Nm]
    t, dt           stamp of the step, time since the previous step                     [s]
"""
