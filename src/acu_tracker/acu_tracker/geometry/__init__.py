"""Directions and their rates in the frames of the earth, the deck and the filter; history of encoders and attitude.

u, du, ddu: unit vector towards the target and its time derivatives; w, dw: angular rate [rad/s] and angular
acceleration [rad/s2] of the deck, FLU.
"""
