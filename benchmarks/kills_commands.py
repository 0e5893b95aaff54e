"""Commands that ``kills.py`` interrupts, and their input files."""

from dataclasses import dataclass, field
from pathlib import Path

ERRORS = """
[[errors]]
frames = ["elbow", "arm"]
most = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]
"""
PLAN = """
yield = 0.9
draws = 100
[limits]
margin_free = 1.0
[[tolerance]]
frames = ["elbow"]
components = ["TX", "TY", "TZ"]
most = 1e-4
"""
COMMANDS = {
    "sweep": "assembly sweep five_bar --grid tx=-0.04:0.04:0.01,ty=0.1:0.15:0.01 "
    "--errors errors.toml --draws 20 --assumption none -o out.nc --json out.json",
    "statistics": "assembly statistics five_bar --errors errors.toml --draws 4000 "
    "--pose ty=0.13 --no-margins -o out.nc --json out.json",
    "tolerances": "assembly tolerances five_bar --grid tx=0:0.01:0.01,ty=0.13 "
    "--plan plan.toml --draws 50 -o out.nc --figure out.png --json out.json",
    "diagnose": "validation diagnose campaign --json out.json --report out.html "
    "--save out.toml",
}
SHARES = {"sweep": 6, "statistics": 5, "tolerances": 3, "diagnose": 3}


@dataclass
class Case:
    """A command and the results of its undisturbed run.

    Attributes:
        words: arguments of the command.
        seconds: [s] duration of the command.
        files: contents of its output files, by name.
        header: first line of its journal, or an empty string without a journal.
        points: number of points in the complete journal.
    """

    words: list[str]
    seconds: float = 0.0
    files: dict[str, bytes] = field(default_factory=dict)
    header: bytes = b""
    points: int = 0


def inputs(folder: Path) -> None:
    """Write the input files of the commands."""
    from tests.planar_arm_for_tests import measure

    (folder / "errors.toml").write_text(ERRORS)
    (folder / "plan.toml").write_text(PLAN)
    measure(folder / "campaign", configurations=8, passes=2, offset=(0, 8e-5))
