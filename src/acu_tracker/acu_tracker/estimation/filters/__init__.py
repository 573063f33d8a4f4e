"""The target filters: Kalman laws, motion models, filters of the axes, Cartesian filter, table of filter kinds.

`target_filter` is the interface for `estimation`.
"""
