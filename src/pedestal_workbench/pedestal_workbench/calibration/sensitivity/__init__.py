"""`pedestal calibrate sensitivity`: beamwidth, squint and G/T from the levels at offsets about a source."""
