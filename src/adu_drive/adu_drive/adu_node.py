"""ROS node of the antenna drive unit: owns the time, publishes the encoders, executes rate commands.

The node runs the unit `adu_drive.unit.Adu`, whose law is `drive_unit.step`; change the drive there. The clock and the
steps are in `timekeeper_node`; this file adds the state file.
"""
from adu_drive import state_file
from adu_drive.params import AduNodeParameters
from adu_drive.timekeeper_node import Timekeeper
from adu_drive.unit import Adu
from pedestal_common.graph.nodes import Node
from pedestal_common.node import shell
from pedestal_common.node.unit import LEVEL_WARN, Diagnosis


class AduNode(Timekeeper):
    """A drive with a state file, which keeps the state of the plant over a restart."""

    parameters: AduNodeParameters
    unit: Adu

    def __init__(self, row: Node) -> None:
        self.unsaved = ''
        self.saved: state_file.PlantState | None = None
        super().__init__(row)

    def prepare(self, unit: shell.Unprepared) -> None:
        """Compile the laws, then resume the plant state in the state file."""
        super().prepare(unit)
        saved = state_file.read(self.parameters.state_file) if self.parameters.state_file else None
        if saved is not None:
            assert isinstance(unit, Adu)
            unit.resume(saved)
            self.get_logger().info(f'resumes at azimuth {saved.azimuth:.6f}, elevation {saved.elevation:.6f} rad of '
                                   f'{self.parameters.state_file}')

    def begin(self) -> None:
        """Begin the steps, and save the plant state once per second."""
        super().begin()
        if self.parameters.state_file:
            self.every(1.0, self.save)

    def save(self) -> None:
        """Save the plant state, and keep the reason of a failure for `diagnosed`.

        Because the end of a run disables the drive, the saved `enabled` then keeps its value from before the end.
        """
        state = self.unit.plant_state()
        if self.stopping:
            state = state._replace(enabled=self.saved.enabled if self.saved else False)
        self.saved = state
        try:
            state_file.write(self.parameters.state_file, state)
            self.unsaved = ''
        except OSError as error:
            self.unsaved = f'{self.parameters.state_file}: {error.strerror}'

    def draining(self) -> bool:
        """Save the plant state as soon as the run ends, because `close` may come too late."""
        if self.parameters.state_file and not self.stopping:
            self.save()
        return super().draining()

    def close(self) -> None:
        """Save the plant state and end."""
        if self.parameters.state_file:
            self.save()
        super().close()

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of the drive, with level WARN if the state file could not be written."""
        diagnosis = super().diagnosed()
        if self.unsaved and diagnosis.level < LEVEL_WARN:
            return diagnosis._replace(level=LEVEL_WARN, message=self.unsaved)
        return diagnosis
