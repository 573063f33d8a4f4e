"""Search, acquisition and loss of a target by its signal level: the modes search, acquire and steptrack."""
