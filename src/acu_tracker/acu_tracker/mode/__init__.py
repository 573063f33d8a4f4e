"""The mode of a step: the facts that decide on it, what a change does, and the laws of single modes."""
