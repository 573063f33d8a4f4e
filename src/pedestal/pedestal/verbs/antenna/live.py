"""show a running graph in Foxglove or Lichtblick

Serves every topic of the graph, its frames and the model of the pedestal on a WebSocket of this machine, read only,
until Ctrl-C. Needs the extra pedestal_operator[live].
"""
import pathlib
import shutil


def add_arguments(parser):
    """Port, beams, where the layouts go."""
    parser.add_argument('--port', type=int, default=8765, metavar='PORT', help='on 127.0.0.1; default: 8765')
    parser.add_argument('--beams', type=int, default=0, metavar='N', help='of an electronic array; default: an '
                        'antenna with motors')
    parser.add_argument('--layouts', type=pathlib.Path, metavar='DIR', help='write what viewers open into this new '
                        'folder, and end: layouts for Foxglove and PlotJuggler, the URDF, an .rviz file')


def main(options):
    """Serve until told to end, or write the files; the exit code. Raises FileExistsError where the folder is there."""
    if options.layouts:
        from pedestal_operator.viewers.frames import VIEWER_FOLDER
        shutil.copytree(VIEWER_FOLDER, options.layouts)
        for file in sorted(options.layouts.iterdir()):
            print(file)
        return 0
    from pedestal_operator import live_node
    print('layouts: pedestal live --layouts DIR; Ctrl-C ends the server', flush=True)
    return live_node.main(['--ros-args', '--log-level', 'warn', '-p', f'port:={options.port}',
                           '-p', f'graph.beams:={options.beams}'])
