"""The target filters: Kalman laws and motion models, filters of one axis and of both, Cartesian filter, table of
kinds.

`target_filter` is the interface for `estimation.tracker`.
"""
