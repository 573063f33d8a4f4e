"""Antenna control unit (ACU): from the angle error of the receiver to the rate command of the drive.

`control_unit.step` runs once per drive step; docs/understand/architecture.md explains its order.

References: Ma 2023 ('current' statistical model filter of an antenna; PID position loop), Zhou 2011 (TD, ESO and NLC
of a gyrocompass), Lin 2020 (interacting models), Li 2018 (angle and rate measured), all in docs/understand/papers.md;
Han 2009 (fhan).
"""
