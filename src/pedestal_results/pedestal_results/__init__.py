"""Results of one recorded run: pointing, filter, isolation from the ship, attitude, verdict; its report."""
