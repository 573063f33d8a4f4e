"""Laws of a monopulse receiver, which the simulated receiver and the receiver of I/Q samples run."""
