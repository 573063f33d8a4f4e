"""A drive of your own that follows angles: the amplifiers close the position loops themselves.

    pedestal run uav_flyby --pacing realtime --param adu.period=0.02 --drive 'position_drive.py 5006 --truth'

It differs from rate_drive.py in one function: the numbers for the amplifiers are set-points [rad], the integral of the
rate commands.
"""
from rate_drive import PERIOD_S, Drive, main

MAX_LEAD_RAD = 0.1
"""Largest distance of a set-point from the measured angle [rad]: above the following error of the amplifiers at the
largest rate. An axis that is blocked therefore does not jump when it is free again."""


class PositionDrive(Drive):
    """Drive whose amplifiers follow set-points."""

    set_points = None

    def command(self, rates, measured):
        """Return the set-points; the first ones are the measured angles, so that nothing moves at the start."""
        if not measured:
            return self.set_points or ['nan', 'nan']
        if self.set_points is None:
            self.set_points = measured[:2]
        self.set_points = [min(max(angle + rate * PERIOD_S, actual - MAX_LEAD_RAD), actual + MAX_LEAD_RAD)
                           for angle, rate, actual in zip(self.set_points, rates, measured)]
        return self.set_points


if __name__ == '__main__':
    main(PositionDrive)
