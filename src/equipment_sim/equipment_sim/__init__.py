"""Simulated equipment for the nodes of pedestal_hardware, to rehearse without the devices.

    drives     four simulated CiA 402 drives on a socketcand server, with the plant of adu_drive behind them
    iq         simulated I/Q samples of target, antenna and front end, sent as a receiver of samples gets them
    ins        INS of a simulated ship that sends NMEA sentences
    rotator    rotator of a protocol on a pseudo terminal

The programs connect to those nodes as real equipment does. pedestal_hardware never imports this package.
"""
