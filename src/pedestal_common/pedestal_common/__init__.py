"""Code and tables that two or more packages of the pedestal share.

Frames
    earth   ENU on topics (REP 103); azimuth clockwise from north where an angle of the earth is meant.
    deck    FLU: x to the bow, y to port, z up. Mechanical azimuth is clockwise from the bow, as on the labels of
            antennas, so it turns opposite to a REP 103 yaw; elevation is up from the deck.
    beam    b along the beam, c cross-elevation (direction of growing azimuth), e direction of growing elevation.
    ashore  the deck's bow points north: deck azimuth and earth azimuth are then the same number.

Units are SI and radians; degrees and decibels appear only in texts for people, or where a name states them.

Symbols
    A, E        azimuth, elevation                                    [rad]
    dX, dE      cross-elevation and elevation off the beam            [rad]
    w           angular velocity of the deck against the earth, FLU   [rad/s]
    mat_ed      rotation deck -> earth (columns are the deck's axes in ENU)
"""
