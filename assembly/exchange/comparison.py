"""Another program's reading of a robot's file, beside what was read here.

MuJoCo is not needed.  Where it is installed it reads URDF and MJCF in a process of its
own: no file can end this one, nor keep it waiting for long.
"""

import importlib.util
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import NDArray

from assembly.exchange.mechanism import Mechanism

AGREED = 1e-9  # [rad, m, kg over the largest] what another program may differ by
POSTURES = 20
_LONGEST = 60.0  # [s] that the other program may take
_WORKER = "from assembly.exchange.mujoco_reading import main; main()"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What another program read in a file, compared with what was read here.

    Attributes:
        reader: its name and version.
        file: that both read.
        why_not: the reason where it could not be compared, else empty.
        bodies: how many were compared.
        masses: of how many bodies.
        loops: how many.
        difference: the largest, [rad, m] or relative mass; lengths over the robot's
            size where that is above 1 m.
        where: of the largest difference, in words.
        weights: [kg] and (3,) [m] of bodies whose mass only the other program knows.
    """

    reader: str
    file: str
    why_not: str = ""
    bodies: int = 0
    masses: int = 0
    loops: int = 0
    difference: float = 0.0
    where: str = ""
    weights: Mapping[str, tuple[float, NDArray]] = field(default_factory=dict)

    @property
    def agrees(self) -> bool:
        """Whether it found the same robot; what was not compared is no difference."""
        return self.difference <= AGREED

    def table(self) -> dict[str, Any]:
        """Return plain values for ``--json``."""
        keys = ("reader", "file", "why_not", "bodies", "masses", "loops", "difference",
                "where")  # fmt: skip
        return {key: getattr(self, key) for key in keys}

    def text(self) -> str:
        """One line for people."""
        if self.why_not:
            return f"{self.file} was compared with no other program: {self.why_not}"
        what = f"bodies {self.bodies}, masses {self.masses}, loops {self.loops}"
        if not self.agrees:
            return (
                f"{self.reader} reads {self.file} otherwise: {self.where} differs by "
                f"{self.difference:.2g}; find out which is right"
            )
        return (
            f"{self.reader} reads {self.file} alike within {self.difference:.1e} in "
            f"{POSTURES} random postures: {what}"
        )


def compare(mechanism: Mechanism, path: Path) -> Comparison:
    """Compare a mechanism with what another program reads in its file.

    Args:
        mechanism: as it was read, or as it was written.
        path: of the file.

    Returns:
        What was compared, or why nothing was.
    """
    name = path.name
    if path.suffix.lower() not in {".urdf", ".xml"}:
        return Comparison("", name, f"MuJoCo reads no {path.suffix.upper()[1:]}")
    if importlib.util.find_spec("mujoco") is None:
        return Comparison("", name, "MuJoCo is not installed")
    with TemporaryDirectory() as folder:
        given, made = Path(folder) / "given", Path(folder) / "made"
        given.write_bytes(pickle.dumps((mechanism, path.absolute())))
        run = [sys.executable, "-c", _WORKER, str(given), str(made)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        try:
            subprocess.run(
                run, cwd=folder, env=environment, capture_output=True, check=False,
                stdin=subprocess.DEVNULL, timeout=_LONGEST,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return Comparison("", name, f"MuJoCo took longer than {_LONGEST:g} s")
        if not made.is_file():
            return Comparison("", name, "MuJoCo ended without an answer")
        answer = pickle.loads(made.read_bytes())
    return answer if isinstance(answer, Comparison) else Comparison("", name, "none")
