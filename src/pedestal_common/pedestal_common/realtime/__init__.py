"""What a node of a realtime graph believes: the time, and of what arrives the messages of the right writer."""
