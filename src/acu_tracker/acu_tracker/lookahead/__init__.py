"""Look-ahead on the levelled deck: keyholes, hidden sectors."""
