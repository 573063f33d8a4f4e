"""Four simulated CiA 402 drives on a CAN bus, a program of its own.

    law               motion control and state machine of a drive, with the plant of adu_drive behind it
    unit              unit of the simulated drives: plant, injected faults, adu/truth
    objects           object dictionary of a drive
    can_drive         CANopen side of a drive: objects, PDO, heartbeat
    socketcand_server bus: a server that speaks as socketcand does
    drives_node       node that runs these parts
"""
