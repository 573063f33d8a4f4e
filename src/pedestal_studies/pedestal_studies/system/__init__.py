"""Studies of the whole control system, measured against our own targets; one study in each module."""
