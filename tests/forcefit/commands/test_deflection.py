"""The command ``forcefit assembly deflection``."""

import json

import pytest

from forcefit.assembly.files.robot_file import write_robot
from tests.assembly.platform_stiffness.test_deflection import shallow_arch


def test_deflection_curve_includes_clearance_and_contact(run, tmp_path):
    picture = tmp_path / "curve.svg"
    status, out, _ = run(
        "assembly", "deflection", "hexapod", "--along", "fz=-100:100:50", "--json",
        "-", "--figure", str(picture),
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["loads"] == [-100.0, -50.0, 0.0, 50.0, 100.0]
    assert answer["free_in_clearances"] == [False, False, True, False, False]
    assert answer["deflection"][4] == pytest.approx(-answer["deflection"][0], rel=1e-6)
    assert {event["kind"] for event in answer["events"]} == {"contact", "release"}
    assert picture.stat().st_size > 1000


def test_followed_path_continues_beyond_limit_points(run, tmp_path):
    """The equilibrium path of a von Mises truss has two limit points."""
    column = tmp_path / "arch.toml"
    write_robot(shallow_arch().robot, column)
    picture = tmp_path / "path.svg"
    status, out, _ = run(
        "assembly", "deflection", str(column), "--along", "fy=0:-300:15", "--follow",
        "--json", "-", "--figure", str(picture),
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    first, second = answer["events"]
    assert first["what"].startswith("limit point, an extremum of the load: platform")
    assert first["load"] == pytest.approx(-second["load"], rel=1e-6)
    assert min(answer["deflection"]) < -0.2
    assert picture.stat().st_size > 1000
