"""Simulated equipment for the nodes of pedestal_hardware, to rehearse without the devices.

The programs connect to those nodes as real equipment does. pedestal_hardware never imports this package.
"""
