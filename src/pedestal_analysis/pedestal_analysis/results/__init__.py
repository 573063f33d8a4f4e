"""Results of a recorded run: pointing, consistency of the filter, isolation from the ship, attitude."""
