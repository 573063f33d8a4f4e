"""The package stands on pedestal_common alone and needs no ROS: a recording is read where neither is installed."""
import ast
import pathlib
import subprocess
import sys

import pedestal_recording

FOLDER = pathlib.Path(pedestal_recording.__file__).parent
COLUMNS = ('receiver_law', 'drive_law', 'ship_motion_sim', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive')
WITHOUT_ROS = f"""
import sys
sys.modules.update(dict.fromkeys(('rclpy', 'rosidl_runtime_py', *{COLUMNS!r})))  # an import of one fails
import importlib
for name in {[file.stem for file in FOLDER.glob('*.py') if not file.stem.endswith('_node')]!r}:
    importlib.import_module('pedestal_recording.' + name)
"""


def imported(file):
    """Names of the modules that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{file.name}: a relative import'
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def test_of_ours_it_imports_itself_and_pedestal_common():
    ours = {name for file in FOLDER.glob('*.py') for name in imported(file)
            if name.startswith(('pedestal_', *COLUMNS))}
    assert ours and all(name.startswith(('pedestal_recording.', 'pedestal_common.')) for name in ours)


def test_it_is_imported_without_ros():
    done = subprocess.run([sys.executable, '-c', WITHOUT_ROS], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
