"""Files of a bag: where they are, their order, and the errors of bags that cannot be read."""
import pathlib
import re

import yaml
from mcap.records import Channel

from pedestal_common.quantities import Json
from pedestal_common.text_files import plain_yaml
from pedestal_recording import mcap_file
from pedestal_recording.mcap_file import BagError

_NUMBERED = re.compile(r'(.+)_(\d+)\.mcap')  # pattern of the file name NAME_0.mcap, NAME_1.mcap and so on of a bag


def locate(path: str | pathlib.Path) -> list[pathlib.Path]:
    """Return the MCAP files of a bag, a directory or one file, in their order.

    Each restart of the recorder begins a new file: NAME_0.mcap, NAME_1.mcap and so on. Files with other names are in
    the order of metadata.yaml. Raises BagError for no file, for several files without an order, or for messages that
    are compressed one by one.
    """
    path = pathlib.Path(path)
    try:
        if not path.is_dir():
            return [path]
        files = next(filter(None, (sorted(path.glob(form)) for form in ('*.mcap', '*.db3', '*.mcap.*', '*.db3.*'))),
                     [])
    except OSError as error:
        raise BagError(f'{path}: {mcap_file.reason(error)}') from None
    described = _described(path)
    if str(described.get('compression_mode', '')).lower() == 'message':
        raise compressed_messages(path, described.get('compression_format'))
    if len(files) == 1 or files and files[0].suffix not in ('.mcap', '.db3'):
        return files[:1]
    numbered = [(match[1], int(match[2]), file) for file in files if (match := _NUMBERED.fullmatch(file.name))]
    if files and len(numbered) == len(files) and len({name for name, _, _ in numbered}) == 1:
        return [file for _, _, file in sorted(numbered)]
    named = described.get('relative_file_paths')
    if files and isinstance(named, list) and sorted(map(str, named)) == [file.name for file in files]:
        return [path / name for name in named]
    raise BagError(f'{path}: {len(files)} .mcap files in it, must be one, or NAME_0.mcap, NAME_1.mcap ... in their '
                   'order')


def _described(path: pathlib.Path) -> dict[str, Json]:
    """Return the content of metadata.yaml, {} if the file is missing or unreadable."""
    try:
        return dict(plain_yaml.read(path / 'metadata.yaml')['rosbag2_bagfile_information'])
    except (OSError, yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError, ValueError):
        return {}


def compressed_messages(path: pathlib.Path, name: str | None) -> BagError:
    """Return the BagError for a bag whose messages are compressed one by one; name: format of the compression."""
    folder = path.parent if (path.parent / 'metadata.yaml').is_file() else path
    return BagError(f"{path}: its messages are compressed one by one ({name}); `ros2 bag convert -i {folder} -o "
                    "plain.yaml` decompresses them, with plain.yaml = 'output_bags: [{uri: plain, storage_id: mcap, "
                    "all: true}]'")


def foreign_encoding(file: pathlib.Path, channel: Channel) -> BagError:
    """Return the BagError for a channel with another encoding than CDR."""
    return BagError(f'{file}: {channel.topic} is encoded as {channel.message_encoding!r}: not a ROS 2 recording')
