"""The laws of the drive's controller, on the motor shaft."""
