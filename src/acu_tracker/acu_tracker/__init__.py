"""Antenna control unit (ACU): from the angle error of the receiver to the rate command of the drive.

`control_unit.step` runs once per drive step; docs/architecture.md explains its order.

References: paper 000 (Ma Jijun et al. 2023, 'current' statistical model filter of an antenna; PID position loop);
paper 001 (TD, ESO and NLC of a gyrocompass); paper 003 (Lin Di et al. 2020, interacting models); paper 004 (Li Hongwei
et al. 2018, angle and rate measured); Han 2009 (fhan).
"""
