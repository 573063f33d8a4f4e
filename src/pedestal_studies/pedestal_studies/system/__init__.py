"""Studies of the whole product against our own targets."""
