"""Where the target is and how it moves: the filters of the angles, the Cartesian one, and which of them is used."""
