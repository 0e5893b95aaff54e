"""Comparison of the robot that forcefit and MuJoCo read from the same file.

MuJoCo is optional.  It reads URDF and MJCF files in a separate process, so that an
invalid file can neither crash nor block this process.
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

from forcefit.assembly.exchange.mechanism import Mechanism
from forcefit.assembly.model.inertia import MassProperties

# [rad, m, -] largest accepted difference of poses and masses
AGREED = 1e-9
POSTURES = 20
_LONGEST = 60.0  # [s] maximum run time of MuJoCo
_WORKER = "from forcefit.assembly.exchange.mujoco_reading import main; main()"


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of the robots that forcefit and another program read from a file.

    Attributes:
        reader: name and version of the other program.
        file: name of the file.
        why_not: reason why no comparison was possible; otherwise empty.
        bodies: number of compared bodies.
        masses: number of bodies whose mass and moments of inertia were compared.
        loops: number of compared loops.
        difference: largest difference of poses [rad, m] and relative difference of
            masses.  Lengths are divided by the robot size if it exceeds 1 m.
        where: body or loop with the largest difference.
        weights: mass properties of bodies that only the other program can compute.
    """

    reader: str
    file: str
    why_not: str = ""
    bodies: int = 0
    masses: int = 0
    loops: int = 0
    difference: float = 0.0
    where: str = ""
    weights: Mapping[str, MassProperties] = field(default_factory=dict)

    @property
    def agrees(self) -> bool:
        """Whether both programs read the same robot from the file."""
        return self.difference <= AGREED

    def table(self) -> dict[str, Any]:
        """Return the values for the option ``--json``."""
        keys = ("reader", "file", "why_not", "bodies", "masses", "loops", "difference",
                "where")  # fmt: skip
        return {key: getattr(self, key) for key in keys}

    def text(self) -> str:
        """Return the result as one line of text."""
        if self.why_not:
            return f"{self.file} was not compared with another program: {self.why_not}"
        what = f"bodies {self.bodies}, masses {self.masses}, loops {self.loops}"
        if not self.agrees:
            return (
                f"{self.reader} reads {self.file} differently: {self.where} "
                f"differs by {self.difference:.2g}; check which program "
                "reads the file correctly"
            )
        return (
            f"{self.reader} reads the same robot from {self.file}: largest difference "
            f"{self.difference:.1e} in {POSTURES} random postures; {what}"
        )


def compare(mechanism: Mechanism, path: Path) -> Comparison:
    """Compare a mechanism with the robot that MuJoCo reads from its file.

    Args:
        mechanism: mechanism that was read from or written to the file.
        path: path of the file.

    Returns:
        The comparison.  If none was possible, it contains the reason.
    """
    name = path.name
    if path.suffix.lower() not in {".urdf", ".xml"}:
        return Comparison(
            "", name, f"MuJoCo does not read {path.suffix.upper()[1:]} files"
        )
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
            return Comparison("", name, "MuJoCo terminated without a result")
        answer = pickle.loads(made.read_bytes())
    return answer if isinstance(answer, Comparison) else Comparison("", name, "none")
