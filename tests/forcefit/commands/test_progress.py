"""Progress reports of long computations."""

import logging

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, MeshLink, Robot
from forcefit.assembly.platform_stiffness.deflection import deflection_curve
from forcefit.assembly.robots import load_robot
from forcefit.commands import progress
from forcefit.commands.progress import report_loading
from forcefit.inputs.errors import BadInput


def test_progress_line_is_printed_at_most_every_two_seconds(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.progress_lines() as update:
        for step in range(1, 9):
            now[0] = 0.6 * step
            update("steps", step, 160)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "forcefit: steps: 4 of at most 160", "forcefit: steps: 8 of at most 160"
    ]  # fmt: skip


def test_progress_reports_every_step_of_an_exact_solution():
    steps = []
    posture = home_posture(load_robot("five_bar"))
    solved = solve_exact(posture, progress=lambda done, most: steps.append(done))
    assert steps == list(range(1, solved.iterations + 1))


def test_progress_reports_every_load_of_a_deflection_curve():
    said = []
    posture = home_posture(load_robot("hexapod"))
    deflection_curve(
        posture, 5, np.array([0.0, -10.0, -20.0]), state="exact",
        progress=lambda what, done, most: said.append(what),
    )  # fmt: skip
    # other messages are printed while events are located
    assert set(said) >= {f"steps at load {load}" for load in (0, -10, -20)}


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_shows_the_number_of_solved_links(terminal, monkeypatch, capsys):
    """A line is printed for each link that is solved; terminals also show a bar."""
    monkeypatch.setenv("FORCE_COLOR" if terminal else "NO_COLOR", "1")
    log = logging.getLogger("forcefit.links")
    before = log.level, log.handlers
    try:
        report_loading()
        for done in range(4):
            log.debug("%d of 3 links", done, extra={"done": done, "total": 3})
            if done == 1:  # the other links are stored
                log.info('finite elements of frame "arm", arm.stl')
    finally:
        log.level, log.handlers = before
    shown = capsys.readouterr().err
    assert 'forcefit: finite elements of frame "arm", arm.stl' in shown
    assert ("1/3" in shown) == ("3/3" in shown) == terminal
    assert "of 3 links" not in shown


def test_progress_bar_is_completed_after_an_error(monkeypatch, tmp_path):
    """An incomplete bar would remain on the terminal."""
    log, told = logging.getLogger("forcefit.links"), []
    handler = logging.Handler()
    handler.emit = lambda record: told.append((record.done, record.total))
    link = MeshLink(tmp_path / "none.stl", "z=0", "z=0.1", 7e10, 0.3)
    robot = Robot("r", "tip", (Frame("tip", translation=[0.1, 0, 0], link=link),))
    monkeypatch.setattr(log, "handlers", [handler])
    monkeypatch.setattr(log, "level", logging.DEBUG)
    with pytest.raises(BadInput, match=r"none\.stl"):
        solve_links(robot)
    assert told == [(0, 1), (1, 1)]
