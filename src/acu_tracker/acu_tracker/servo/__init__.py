"""The position loop of an axis: controllers, shaper of the reference, limits, and detectors of drive faults."""
