"""What a recording says of the run: pointing, honesty of the filter, isolation from the ship, attitude."""
