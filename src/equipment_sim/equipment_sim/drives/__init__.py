"""Four simulated CiA 402 drives on a CAN bus, a program of its own."""
