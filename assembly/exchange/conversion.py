"""Result of the conversion of a robot file, and its report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from forcefit.assembly.exchange.comparison import Comparison
from forcefit.assembly.model.contact_closures import loops
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import quoted


@dataclass(frozen=True, eq=False)
class Conversion:
    """Result of the conversion of a robot file.

    Attributes:
        robot: robot that was written or read.
        files: output files.
        open_before: loop mismatch in the home pose of the file [rad, m].
        open_after: loop mismatch in the computed home pose [rad, m].
        drives_held: whether the drive coordinates of the file are unchanged.
        difference: largest difference between the body poses of the robot and of the
            output file in 100 random postures.
        comparisons: comparisons with MuJoCo.
        left_out: descriptions of components that the output file cannot represent.
        taken: descriptions of assumptions that were made because data are missing.
    """

    robot: Robot
    files: tuple[Path, ...]
    open_before: float
    open_after: float
    drives_held: bool
    difference: float
    left_out: tuple[str, ...]
    taken: tuple[str, ...] = ()
    comparisons: tuple[Comparison, ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether all programs read the same robot."""
        return all(comparison.agrees for comparison in self.comparisons)

    def table(self) -> dict[str, Any]:
        """Return the values for the option ``--json``."""
        return {
            "robot": self.robot.name,
            "platform": self.robot.platform,
            "frames": len(self.robot.frames),
            "closures": len(loops(self.robot)),
            "files": [str(path) for path in self.files],
            "home": {
                "open_before": self.open_before,
                "open_after": self.open_after,
                "drives_held": self.drives_held,
            },
            "largest_difference": self.difference,
            "compared": [comparison.table() for comparison in self.comparisons],
            "left_out": list(self.left_out),
            "taken": list(self.taken),
        }

    def text(self) -> str:
        """Return the report as text."""
        robot = self.robot
        count = len(loops(robot))
        lines = [
            f"{robot.name}: {len(robot.frames)} frames, "
            f"{count} loop{'s' * (count != 1)}, platform {quoted(robot.platform)}",
            (
                "read back in 100 random postures: largest difference of body poses "
                f"{self.difference:.1e} (by forcefit, to verify the output file)"
            ),
            *(comparison.text() for comparison in self.comparisons),
        ]
        if count:
            moved = "" if self.drives_held else "; the drive coordinates were changed"
            lines.append(
                f"home pose: loops are open by {self.open_before:.2g} rad or m in the "
                f"pose of the file, {self.open_after:.1e} in the computed pose{moved}"
            )
        lines += [f"taken: {line}" for line in self.taken]
        lines += [f"left out: {line}" for line in self.left_out]
        return "\n".join([*lines, f"written: {', '.join(map(str, self.files))}"])
