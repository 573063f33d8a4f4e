"""The station: it takes the passes of a plan on a running antenna, one after another."""
