"""Laws of a drive of two axes with two motors each, which real and simulated drives run.

drive_state is the drive, axis_control an axis of it. Its units and nodes derive from rate_drive and rate_drive_node,
those of a drive that follows angles from angle_drive.

Angles, rates and torques of the load are deck angles: azimuth clockwise from the bow seen from above (it turns
opposite to a REP 103 yaw), elevation up from the deck. Motor quantities are on the motor shaft.
"""
