"""Alarms: each fault is reported once, with its consequences below it and the action for the operator.

`detectors`    small laws with hysteresis on the motion of the axes
`conditions`   rows of the table whose condition holds in a step: bits in the order of the table
`table`        one row for each alarm: priority, delays, latching, causes, meaning, action
`machine`      states of one alarm (ANSI/ISA-18.2-2016, section 6.2; IEC 62682), a pure function
`annunciator`  records of all alarms: delays, first-out, causes, shelving, reset
`report`       message on acu/alarms

`operating.alarm_desk` has the commands of the operator.

Symbols
    y, dy           encoder angle, rate by the motors' encoders                         [rad], [rad/s]
    u               rate command in force                                               [rad/s]
    e               following error, reference less encoder                             [rad]
    T               torque of an axis on its load, as the drive measures it             [Nm]
    t, dt           stamp of the step, time since the previous step                     [s]
"""
