"""ROS node of the antenna drive unit: owns the drive's time, publishes the encoders, obeys rate commands."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from adu_drive import state_file
from adu_drive.timekeeper_node import Timekeeper
from pedestal_common.node import shell
from pedestal_common.node.unit import LEVEL_WARN


class AduNode(Timekeeper):
    """A drive that remembers where its plant was left."""

    def __init__(self):
        self.unsaved = ''
        self.saved = None
        super().__init__('adu_drive.adu_node')

    def prepare(self, unit):
        """Compile the laws; then go on where the state file, if there is one, left the plant."""
        super().prepare(unit)
        left = state_file.read(self.parameters.state_file) if self.parameters.state_file else None
        if left is not None:
            unit.resume(left)
            self.get_logger().info(f'goes on at azimuth {left.azimuth:.6f}, elevation {left.elevation:.6f} rad, where '
                                   f'{self.parameters.state_file} left it')

    def begin(self):
        """Begin to make the steps, and to note once a second where the plant is."""
        super().begin()
        if self.parameters.state_file:
            self.every(1.0, self.save)

    def save(self):
        """Note where the plant is. A run that ends disables the drive, which is nothing to go on with."""
        left = self.unit.left()
        if self.stopping:
            left = left._replace(enabled=self.saved.enabled if self.saved else False)
        self.saved = left
        try:
            state_file.write(self.parameters.state_file, left)
            self.unsaved = ''
        except OSError as error:
            self.unsaved = f'{self.parameters.state_file}: {error.strerror}'

    def draining(self):
        """Note where the plant is as soon as the end comes: there may be no time for it in `close`."""
        if self.parameters.state_file and not self.stopping:
            self.save()
        return super().draining()

    def close(self):
        """Note where the plant is, then end."""
        if self.parameters.state_file:
            self.save()
        super().close()

    def diagnosed(self):
        """The Diagnosis of the drive, a WARN where its state could not be written."""
        diagnosis = super().diagnosed()
        if self.unsaved and diagnosis.level < LEVEL_WARN:
            return diagnosis._replace(level=LEVEL_WARN, message=self.unsaved)
        return diagnosis


def main(args=None):
    """Run the node to its end; the exit code."""
    return shell.main(AduNode, args)


if __name__ == '__main__':
    sys.exit(main())
