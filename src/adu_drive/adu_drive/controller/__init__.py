"""Laws of the controller of the drive, on the motor shaft."""
