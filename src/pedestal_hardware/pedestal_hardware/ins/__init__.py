"""Input of a real INS: NMEA sentences, or the sensor_msgs/Imu of its driver.

    sentences        NMEA sentences to attitudes, with their checks
    frames           laws: from the frames of a device to those of the graph (REP 103), with mounting and heading zero
    rate_estimator   law: the deck rate from a sequence of attitudes, for a device without rates
    frame_check      law: comparison of attitude and rates, which finds a wrong frame
    conventions      frames that would fit what the check has measured
    input_law        law of one sample: these three in their order
    params           parameters of `ins_input_node`
    unit             from sentences and messages to samples, with those that were dropped
    ins_input_node   node: device in, ship/imu/data and ins/state out
"""
