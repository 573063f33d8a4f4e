"""Code and tables that two or more packages of the pedestal share.

Frames
    earth   east-north-up (ENU, REP 103) on topics. The earth azimuth is clockwise from north.
    deck    forward-left-up (FLU): x to the bow, y to port, z up. The deck azimuth is clockwise from the bow, as on the
            labels of antennas, so it turns opposite to a REP 103 yaw. The elevation is up from the deck.
    beam    b along the beam, c cross-elevation (direction of growing azimuth), e direction of growing elevation.
    ashore  no frame, but the case of a pedestal on land: the bow points north, and deck azimuth and earth azimuth are
            the same number.

Units are SI and radians; degrees and decibels appear only in texts for people, or where a name states them.

Symbols
    A, E        azimuth, elevation                                    [rad]
    dX, dE      angles from the beam to a direction, in cross-elevation and in elevation   [rad]
    w           angular velocity of the deck against the earth, FLU   [rad/s]
    mat_ed      rotation deck -> earth (columns are the deck's axes in ENU)
"""
