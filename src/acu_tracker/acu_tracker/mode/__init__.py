"""Mode of a step: the facts that decide on it, the effects of a change, and the laws of single modes."""
