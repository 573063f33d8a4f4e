"""measure beamwidth, squint and G/T from levels at offsets about the sun or another source

The file of --levels has the columns cross_elevation_deg, elevation_deg and level_db: offset of the beam from the
source, and total power. The first column may be az_deg, an offset in azimuth, which needs --elevation.

--bag takes the levels from a recording in which the commands `offset` of the control unit moved the beam about the
source.

A Gaussian beam, convolved with the disk of the source, is fitted to the power. --flux and --frequency give G/T by the
Y factor, corrected for the size of the source (ITU-R S.733).

--output writes a parameter file for `pedestal run SCENARIO --params-file FILE`.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add levels or recording, properties of the source, and output files."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--levels', type=pathlib.Path, metavar='FILE', help='CSV file of offsets and levels')
    source.add_argument('--bag', type=pathlib.Path, metavar='BAG', help='recording of a scan by commands `offset`')
    for name, metavar, text in (
            ('flux', 'SFU', 'flux density of the source in solar flux units, 1 to 1e6; needs --frequency'),
            ('frequency', 'GHZ', 'frequency of the receiver, 0.1 to 300 GHz'),
            ('diameter', 'DEG', 'diameter of the source, 0 to 5 deg; default: 0.53, the sun, with --flux, else 0'),
            ('bandwidth', 'HZ', 'noise bandwidth of the receiver in a recording; default: value in the recording'),
            ('attenuation', 'DB', 'attenuation by the atmosphere towards the source, 0 to 20 dB; default: 0'),
            ('elevation', 'DEG', 'elevation of the source for offsets in azimuth, 0 to 89 deg')):
        parser.add_argument(f'--{name}', type=float, metavar=metavar, help=text)
    arguments.add_result_files(parser, 'new parameter file with beamwidth and squint', 'new HTML page with the cuts')


def main(options: argparse.Namespace) -> int:
    """Measure, write the files and print the result. Return exit code 0."""
    from pedestal_workbench.calibration.sensitivity import sensitivity
    arguments.check_result_files(options)
    printed, content = sensitivity.main(options)
    print('\n'.join(printed))
    console.write_json(options.json, content)
    return 0
