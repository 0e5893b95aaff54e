"""What a device read, and how its exports are written."""

from dataclasses import dataclass

from numpy.typing import NDArray

from forcefit.inputs.errors import quoted

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254}
LARGEST = 1e12  # of any number of a table


@dataclass(frozen=True)
class Writing:
    """How an export is written, where it does not say so itself.

    Attributes:
        unit: of lengths, None if its header says so.
        decimal: the decimal mark of exports.
        commands_decimal: of the table of commands.
        dates: ``"day_first"`` or ``"month_first"`` for dates with slashes, or None.
        coverage: what an uncertainty (U95, U) is times one standard deviation.
        orientation: order of three angles (:func:`.orientation.orders`), or None.
        angle_unit: of angles whose header has none, or None.
        oriented: whether orientations are read; otherwise they are passed over.
    """

    unit: str | None = None
    decimal: str = "."
    commands_decimal: str = "."
    dates: str | None = None
    coverage: float = 2.0
    orientation: str | None = None
    angle_unit: str | None = None
    oriented: bool = False


@dataclass(frozen=True, eq=False)
class Reading:
    """One point that a device read.

    Attributes:
        file: its file, for messages.
        line: there.
        names: parts of its name, the point's own last.
        position: (3,) [m] in the device's axes; NaN where the device saw nothing.
        sigma: (3,) [m] one standard deviation, NaN where not stated.
        time: [s] on the clock of the file, NaN without one.
        rotation: (3, 3) the target's axes seen from the device's, or None.
    """

    file: str
    line: int
    names: tuple[str, ...]
    position: NDArray
    sigma: NDArray
    time: float
    rotation: NDArray | None = None

    @property
    def place(self) -> str:
        """File, line and name, for messages."""
        return f"{self.file}: line {self.line} ({quoted('::'.join(self.names))})"
