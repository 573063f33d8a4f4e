"""Targets and the monopulse receiver that tracks them: the node tracking_receiver. The detector is that of
receiver_law.

Positions of targets are in ENU, with the origin at the station and axes fixed to the earth. The deck is FLU. The time
of a target counts from the start of the run (stamp 0).
"""
