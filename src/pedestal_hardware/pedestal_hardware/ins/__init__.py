"""Input of a real INS: NMEA sentences, or the sensor_msgs/Imu of its driver."""
