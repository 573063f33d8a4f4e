"""Bags of another writer than ours."""
from mcap.writer import Writer


def write(path, put, definition=b'', **options):
    """Return the path of a bag without a configuration. put(writer, channel) writes its messages with a writer of the
    mcap library; channel(topic, type) declares a channel, whose number it returns."""
    with open(path, 'wb') as stream:
        writer = Writer(stream, **options)
        writer.start('ros2', 'other')
        put(writer, lambda topic, kind: writer.register_channel(
            topic, 'cdr', writer.register_schema(kind, 'ros2msg', definition)))
        writer.finish()
    return path
