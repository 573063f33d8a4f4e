"""Pointing model of the pedestal: its parameters, and the model in force between the directions and the encoders."""
