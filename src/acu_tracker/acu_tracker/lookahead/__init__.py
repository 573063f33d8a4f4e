"""What lies ahead of the deck: keyholes, hidden sectors."""
