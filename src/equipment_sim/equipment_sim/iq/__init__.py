"""Simulated I/Q samples of all channels of a feed.

    unit       unit of `iq_node`: samples of target, antenna and front end
    feed       signal at the outputs of a simulated feed
    sinks      streams that carry samples: VITA 49, ZMQ, SigMF
    iq_node    node that sends the samples
"""
