"""`pedestal calibrate drive`: friction, inertia, lash, bias, encoder and structure of both axes from safe motions."""
