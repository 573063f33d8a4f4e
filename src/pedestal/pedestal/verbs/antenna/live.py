"""show a running graph in Foxglove or Lichtblick

Serves every topic of the graph, its frames and the model of the pedestal on a WebSocket of this machine, read-only,
until Ctrl-C. Needs the extra pedestal_operator[live].
"""
import argparse
import pathlib
import shutil


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add port, beams and folder of the layouts."""
    parser.add_argument('--port', type=int, default=8765, metavar='PORT', help='TCP port on 127.0.0.1; default: 8765')
    parser.add_argument('--beams', type=int, default=0, metavar='N', help='number of beams of an electronic array; '
                        'default: 0, an antenna with motors')
    parser.add_argument('--layouts', type=pathlib.Path, metavar='DIR', help='new folder for the files of viewers '
                        '(layouts for Foxglove and PlotJuggler, the URDF, an .rviz file); nothing is served')


def main(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C, or write the files. Return the exit code. Raises FileExistsError for an existing folder."""
    if options.layouts:
        from pedestal_operator.viewers.frames import VIEWER_FOLDER
        shutil.copytree(str(VIEWER_FOLDER), options.layouts)
        for file in sorted(options.layouts.iterdir()):
            print(file)
        return 0
    from pedestal_operator import live_node
    print(f'ws://127.0.0.1:{options.port} until Ctrl-C; layouts: pedestal live --layouts DIR', flush=True)
    return live_node.main(['--ros-args', '--log-level', 'warn', '-p', f'port:={options.port}',
                           '-p', f'graph.beams:={options.beams}'])
