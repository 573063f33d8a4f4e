"""`pedestal calibrate receiver`: slopes and cross-talk of the tracking receiver from offsets about a beacon."""
