"""Monopulse receiver of I/Q samples.

    params       parameters of this node and of the simulated samples
    front_end    law: samples of a step to angle errors; the search for the carrier
    feed, scan   feeds of the antenna; law of a feed with one output
    unit         unit of `monopulse_receiver_node`
    blocks       blocks of samples with their times; vita49, sigmf: formats; sources: streams
"""
