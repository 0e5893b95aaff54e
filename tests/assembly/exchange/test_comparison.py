"""Conversion of robots if MuJoCo fails or is not installed."""

import importlib.util

import pytest

from forcefit.assembly.exchange import comparison
from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.mjcf import read_mjcf

TEXT = """<mujoco><worldbody><body name="a"><joint name="j"/><geom size="0.1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(TEXT)
    return path


@pytest.mark.parametrize(("worker", "reason"), [
    ("import os; os.abort()", "MuJoCo terminated without a result"),
    ("import time; time.sleep(60)", "MuJoCo took longer than 0.5 s"),
])  # fmt: skip
def test_comparison_reports_failure_of_the_mujoco_process(
    worker, reason, path, monkeypatch
):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    monkeypatch.setattr(comparison, "_WORKER", worker)
    monkeypatch.setattr(comparison, "_LONGEST", 0.5 if "sleep" in worker else 60.0)
    answer = comparison.compare(read_mjcf(path), path)
    assert answer.why_not == reason
    assert answer.agrees


def test_conversion_without_mujoco_reports_missing_comparison(
    path, tmp_path, monkeypatch
):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    answer = convert(path, tmp_path / "robot.toml")
    (told,) = answer.comparisons
    assert told.why_not == "MuJoCo is not installed"
    line = "robot.xml was not compared with another program: MuJoCo is not installed"
    assert line in answer.text()


def test_convert_command_returns_1_if_mujoco_differs(run, path, tmp_path, monkeypatch):
    other = comparison.Comparison("MuJoCo", "robot.xml", "", 1, 1, 0, 0.3, "body a")
    monkeypatch.setattr("forcefit.assembly.exchange.foreign.compare", lambda *_: other)
    status, out, _ = run("convert", path, "-o", tmp_path / "robot.toml")
    assert status == 1
    assert "MuJoCo reads robot.xml differently: body a differs by 0.3" in out
    assert (tmp_path / "robot.toml").is_file()
