"""Define a device reading and the format of device exports."""

from dataclasses import dataclass

from numpy.typing import NDArray

from forcefit.inputs.errors import quoted

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254}
LARGEST = 1e12  # largest accepted absolute value of a number in a table


@dataclass(frozen=True)
class Writing:
    """Declared format of device exports.

    Attributes:
        unit: unit of lengths; None if the header contains it.
        decimal: decimal mark of exports.
        commands_decimal: decimal mark of the table of commands.
        dates: ``"day_first"`` or ``"month_first"`` for dates with slashes; None if
            undeclared.
        coverage: coverage factor, the ratio of an uncertainty U or U95 to the standard
            deviation.
        orientation: order of three angles (:func:`.orientation.orders`); None if
            undeclared.
        angle_unit: unit of angles; None if the header contains it.
        oriented: whether orientations are read.
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
    """A point measured by a device.

    Attributes:
        file: path of the file, for messages.
        line: line in the file.
        names: components of the full name of the point, such as collection, group and
            point.
        position: (3,) [m] position in the device's axes; NaN if the device detected no
            target.
        sigma: (3,) [m] standard deviation of each coordinate; NaN if the file does not
            contain it.
        time: [s] time of the reading; NaN if the file contains no time.
        rotation: (3, 3) rotation matrix from target axes to device axes; None if not
            measured.
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
        """File, line and name of the reading, for messages."""
        return f"{self.file}: line {self.line} ({quoted('::'.join(self.names))})"
