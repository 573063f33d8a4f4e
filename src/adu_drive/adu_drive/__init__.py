"""Antenna drive unit (ADU): two axes, each with two motors that remove the lash of one bull gear.

drive_law contains its controllers, up to the torque of each motor; this package contains its sensors, its current
loops and the plant.

    drive_unit    two axes over one control period T: commands in, encoders out (function `step`)
    axis          one axis: sensors, speed loop of drive_law.axis_control, two current loops, plant
    plant         motors, mechanics, wind, gimbal (rigid bodies on a moving deck), mount (direction of the beam)
    unit          input messages, law, output messages; adu_node runs it
    lanes         many drives at once, computed by vector instructions, for trials
    array         a beam of a phased array, which takes the place of the drive
"""
