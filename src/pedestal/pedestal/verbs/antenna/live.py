"""show a running graph in Foxglove or Lichtblick

Serves every topic of the graph, its frames and the model of the pedestal on a WebSocket of this machine, read-only,
until Ctrl-C. Needs the extra pedestal_operator[live].
"""
import argparse
import pathlib
import shutil

DEFAULT_PORT = 8765


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add port, beams and folder of the layouts."""
    parser.add_argument('--port', type=int, metavar='PORT', help='TCP port on 127.0.0.1; default: 8765')
    parser.add_argument('--beams', type=int, metavar='N', help='number of beams of an electronic array; '
                        'default: 0 (antenna with motors)')
    parser.add_argument('--layouts', type=pathlib.Path, metavar='DIR', help='new folder; the verb only writes the '
                        'files of the viewers into it (layouts for Foxglove and PlotJuggler, the URDF, an .rviz '
                        'file) and ends')


def main(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C, or write the files. Return the exit code. Raises FileExistsError for an existing folder."""
    if options.layouts:
        for name in ('port', 'beams'):
            if getattr(options, name) is not None:
                raise ValueError(f'--{name}: has no effect with --layouts, which serves nothing')
        from pedestal_operator.viewers.frames import VIEWER_FOLDER
        shutil.copytree(str(VIEWER_FOLDER), options.layouts)
        for file in sorted(options.layouts.iterdir()):
            print(file)
        return 0
    from pedestal_operator import live_node
    port = DEFAULT_PORT if options.port is None else options.port
    print('layouts: pedestal live --layouts DIR; Ctrl-C ends the server', flush=True)
    return live_node.main(['--ros-args', '--log-level', 'warn', '-p', f'port:={port}',
                           '-p', f'graph.beams:={options.beams or 0}'])
