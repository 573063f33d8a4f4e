"""Base of the nodes of drives that follow rates: a Timekeeper with a file that keeps the state of the plant over a
restart."""
from drive_law.params import AduNodeParameters
from drive_law.rate_drive import PlantState, RateDrive, read_plant_state, write_plant_state
from drive_law.timekeeper_node import Timekeeper
from pedestal_common.graph.nodes import Node
from pedestal_common.node import shell
from pedestal_common.node.unit import LEVEL_WARN, Diagnosis


class RateDriveNode(Timekeeper):
    """Node of a RateDrive."""

    parameters: AduNodeParameters
    unit: RateDrive

    def __init__(self, row: Node) -> None:
        self.unsaved = ''
        self.saved: PlantState | None = None
        super().__init__(row)

    def prepare(self, unit: shell.Unprepared) -> None:
        """Compile the laws, then resume the plant state in the state file."""
        super().prepare(unit)
        saved = read_plant_state(self.parameters.state_file) if self.parameters.state_file else None
        if saved is not None:
            assert isinstance(unit, RateDrive)
            unit.resume(saved)
            self.get_logger().info(f'resumes at azimuth {saved.azimuth:.6f}, elevation {saved.elevation:.6f} rad of '
                                   f'{self.parameters.state_file}')

    def begin(self) -> None:
        """Begin the steps, and save the plant state once per second."""
        super().begin()
        if self.parameters.state_file:
            self.every(1.0, self.save)

    def save(self) -> None:
        """Save the plant state, and keep the reason of a failure for `diagnosed`. Because the end of a run disables
        the drive, the saved `enabled` then keeps its value from before the end."""
        state = self.unit.plant_state()
        if self.stopping:
            state = state._replace(enabled=self.saved.enabled if self.saved else False)
        self.saved = state
        try:
            write_plant_state(self.parameters.state_file, state)
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
