"""gpredict itself points the antenna of a running graph at a satellite that is made to pass now.

    pedestal run uav_flyby --pacing realtime --duration 600 --rotctld --param acu.initial_mode=standby
    python docs/rotator/gpredict.py [PORT] [SECONDS]

Debian's gpredict runs on a screen of its own (Xvfb) with settings of its own: one satellite, one rotator with
threshold 0.1 deg and cycle 100 ms. Keys and clicks (xdotool) open its antenna control, choose Track and Engage. Every
5 s this program prints the direction of the satellite by sgp4, and the direction of the antenna from the server, for
SECONDS (default 60). PORT (default 4533) is that of the server.
"""
import argparse
import datetime
import math
import os
import pathlib
import select
import shutil
import socket
import subprocess
import sys
import tempfile
import time

import numpy as np
from sgp4 import exporter
from sgp4.api import WGS72, Satrec, jday

PROGRAMS = 'gpredict', 'Xvfb', 'xdotool'
MISSING = [program for program in PROGRAMS if shutil.which(program) is None]

STATION = math.radians(55.6167), math.radians(12.65)
"""Latitude, longitude."""

HIGH = 25.0
"""Elevation [deg] at which the satellite is now, and rises."""

FILES = {
    'gpredict.cfg': '[GLOBAL]\nOPEN_MODULES=Test\nCURRENT_PAGE=0\n[TLE]\nAUTO_UPDATE_FREQ=0\n',
    'sample.qth': '[QTH]\nLOCATION=Copenhagen\nLAT=55.6167\nLON=12.6500\nALT=0\n',
    'modules/Test.mod': '[GLOBAL]\nSATELLITES=90001;\n',
    'satdata/test.cat': 'Test\n90001\n',
    'satdata/90001.sat': '[Satellite]\nVERSION=1.1\nNAME=TEST\nNICKNAME=TEST\nTLE1={}\nTLE2={}\nSTATUS=0\n',
    'hwconf/pedestal.rot': '[Rotator]\nHost=127.0.0.1\nPort={}\nCycle=100\nThreshold=0.1\nMinAz=0\nMaxAz=360\n'
                           'MinEl=0\nMaxEl=90\nAzType=0\nAzStopPos=0\n'}
"""Of its folder of settings."""

START_TIME_S = 120.0
"""For what gpredict and its screen do in some seconds on a quiet machine."""

MENU, ANTENNA_CONTROL = (681, 44), ('Up',) * 5 + ('Return',)
"""The button of the module's menu in a window of 700 x 700, and the keys from there."""

TRACK, ENGAGE = (346 / 837, 196 / 330), (780 / 837, 196 / 330)
"""Buttons of the antenna control, of its width and height."""


def now():
    """(Julian day, its fraction) of UTC."""
    t = datetime.datetime.now(datetime.timezone.utc)
    return jday(t.year, t.month, t.day, t.hour, t.minute, t.second + t.microsecond * 1e-6)


def angles(satellite, day):
    """(azimuth 0 to 360, elevation) [deg] of a Satrec from the STATION, on the sphere of the earth's ellipsoid."""
    _, position, _ = satellite.sgp4(*day)
    centuries = (sum(day) - 2451545.0) / 36525.0
    sidereal = math.radians((67310.54841 + (876600.0 * 3600.0 + 8640184.812866) * centuries) / 240.0 % 360.0)
    latitude, longitude = STATION[0], STATION[1] + sidereal
    up = np.array([math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude),
                   math.sin(latitude)])
    east = np.array([-math.sin(longitude), math.cos(longitude), 0.0])
    flattening = 1.0 / 298.257
    C = 1.0 / math.sqrt(1.0 - flattening * (2.0 - flattening) * math.sin(latitude)**2)
    station = 6378.137 * C * up * (1.0, 1.0, (1.0 - flattening)**2)
    e, n, u = (axis @ (np.array(position) - station) for axis in (east, np.cross(up, east), up))
    return math.degrees(math.atan2(e, n)) % 360.0, math.degrees(math.atan2(u, math.hypot(e, n)))


def passing():
    """The Satrec of a low orbit that is HIGH over the STATION now, rises, and passes north of it."""
    day = now()
    found = []
    for node in range(0, 360, 3):
        for anomaly in np.arange(0.0, 360.0, 1.5):
            satellite = Satrec()
            satellite.sgp4init(WGS72, 'i', 90001, sum(day) - 2433281.5, 0.0, 0.0, 0.0, 1e-4, 0.0, math.radians(65.0),
                               math.radians(anomaly), 2.0 * math.pi * 14.6 / 1440.0, math.radians(node))
            azimuth, elevation = angles(satellite, day)
            if 270.0 < azimuth < 350.0 and angles(satellite, (day[0], day[1] + 30.0 / 86400.0))[1] > elevation:
                found.append((abs(elevation - HIGH), node, anomaly, satellite))
    return min(found)[-1]


class Gpredict:
    """It tracks from now on, until it is closed. satellite: its Satrec. home: a folder; port: of the server."""

    def __init__(self, home, port):
        self.satellite = passing()
        values = {'satdata/90001.sat': exporter.export_tle(self.satellite), 'hwconf/pedestal.rot': (port,)}
        for name, text in FILES.items():
            file = pathlib.Path(home, 'Gpredict', name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.format(*values.get(name, ())))
        self._processes = []
        self._environment = {**os.environ, 'HOME': str(home), 'XDG_CONFIG_HOME': str(home), 'NO_AT_BRIDGE': '1'}
        try:
            self._environment['DISPLAY'] = self._screen()
            self._start('gpredict')
            self._engage()
        except BaseException:
            self.close()
            raise

    def _start(self, *command, **options):
        """A process that is silent, because one that is left behind would keep the output of its parent open."""
        self._processes.append(subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                                stderr=subprocess.DEVNULL, env=self._environment, **options))

    def _screen(self):
        """Start Xvfb; the name of its display."""
        reader, writer = os.pipe()
        self._start('Xvfb', '-displayfd', str(writer), '-screen', '0', '1280x900x24', '-nolisten', 'tcp',
                    pass_fds=(writer,))
        os.close(writer)
        with open(reader) as told:
            if not select.select([told], [], [], START_TIME_S)[0]:
                raise TimeoutError('Xvfb does not start')
            return f':{told.readline().strip()}'

    def _engage(self):
        """Open the antenna control; a machine that is busy draws late."""
        self._await('Gpredict: Test')
        control, deadline = '', time.monotonic() + START_TIME_S
        while not control:
            if time.monotonic() > deadline:
                raise TimeoutError('gpredict shows no antenna control')
            time.sleep(2.0)
            self._do('mousemove', *MENU, 'click', 1)
            time.sleep(1.0)
            self._do('key', *ANTENNA_CONTROL)
            control = self._await('Rotator Control', 5.0)
        time.sleep(2.0)
        width, height = (int(line.partition('=')[2]) for line in self._do('getwindowgeometry', '--shell', control)
                         .splitlines() if line.startswith(('WIDTH', 'HEIGHT')))
        for x, y in (TRACK, ENGAGE):
            self._do('mousemove', '--window', control, round(x * width), round(y * height), 'click', 1)
            time.sleep(1.0)

    def _await(self, name, seconds=60.0):
        """The number of a window of this name, '' where there is none within so many seconds."""
        deadline = time.monotonic() + seconds
        while not (found := self._do('search', '--name', name).split()) and time.monotonic() < deadline:
            time.sleep(0.2)
        return found[0] if found else ''

    def _do(self, *words):
        return subprocess.run(['xdotool', *map(str, words)], env=self._environment, capture_output=True, text=True,
                              timeout=START_TIME_S).stdout

    def close(self):
        """End it and its screen. gpredict is killed: told to end, it may wait for a lock of its own for ever."""
        for process in self._processes[1:]:
            process.kill()
            process.wait(START_TIME_S)
        for screen in self._processes[:1]:
            screen.terminate()
            screen.wait(START_TIME_S)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('port', nargs='?', type=int, default=4533)
    parser.add_argument('seconds', nargs='?', type=float, default=60.0)
    options = parser.parse_args()
    if MISSING:
        print(f'not installed: {", ".join(MISSING)}', file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as home:
        gpredict = Gpredict(home, options.port)
        try:
            with socket.create_connection(('127.0.0.1', options.port), 5.0) as server:
                for _ in range(round(options.seconds / 5.0)):
                    time.sleep(5.0)
                    server.sendall(b'p\n')
                    told = server.recv(100).split()
                    print('satellite {:7.2f} {:6.2f}'.format(*angles(gpredict.satellite, now())),
                          'antenna {:7.2f} {:6.2f} deg'.format(*map(float, told)), flush=True)
        finally:
            gpredict.close()
    return 0


if __name__ == '__main__':
    sys.exit(main())
