"""What a recorded run achieved: pointing, honesty of the filter, isolation from the ship, attitude."""
