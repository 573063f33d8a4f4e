"""Servo drives, rotators, level receivers and INS in place of simulated nodes. Their simulated devices: equipment_sim.

    cia402          state machine of a drive by CiA 402: statusword, controlword, transitions
    errors          names of the error codes, and the faults of the antenna drive unit that follow from them
    params          parameters of `drive_node` and of the simulated drives
    servo_drives    law of `drive_node`: from the values of four drives to their commands
    unit            unit of `drive_node`, which runs this law between the messages of the graph
    drive_node      node that owns the time, with the bus
    bus             the five calls of a bus; pdo: the numbers that a bus exchanges once a period
    commissioning   settings of a drive that are written and read back before it is used
    canopen_bus     the bus of CANopen drives; can_line: its frames, over socketcand or by python-can
    rotator_node    node of a rotator, which closes its own position loop; rotator_params, rotator: its parts
    lines           devices that send lines on their own: sources, reader, base of their nodes
    level           receiver with a level only: level_receiver_node
    ins             real INS: ins_input_node

A drive has the number 2 a + m in all arrays: a is its axis (0 azimuth, 1 elevation), m its motor (0 or 1).
"""
