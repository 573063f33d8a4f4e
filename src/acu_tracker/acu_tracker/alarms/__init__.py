"""Alarms: what is wrong, told once, with what it leads to under it and what the operator shall do.

`detectors`    small laws with hysteresis on what the axes do
`conditions`   which rows of the table are there in a step: bits in the order of the table
`table`        one row for each alarm: priority, delays, latching, causes, meaning, action
`machine`      the states of one alarm (ANSI/ISA-18.2-2016, section 6.2; IEC 62682), a pure function
`annunciator`  the records of all alarms: delays, first-out, causes, shelving, reset
`report`       the message on acu/alarms
`desk`         what an operator does with them

Symbols
    y, dy           encoder angle, rate by the motors' encoders                         [rad], [rad/s]
    u               rate command in force                                               [rad/s]
    e               following error, reference less encoder                             [rad]
    T               torque of an axis on its load, as the drive measures it             [Nm]
    t, dt           stamp of the step, time since the one before                        [s]
"""
