"""Progress of commands that are usually done at once."""

import numpy as np

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import home_posture
from assembly.platform_stiffness.deflection import deflection_curve
from assembly.robots import load_robot
from forcefit.commands import progress


def test_line_of_progress_is_printed_every_two_seconds_and_no_oftener(
    capsys, monkeypatch
):
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


def test_every_step_of_an_exact_solution_is_reported():
    steps = []
    posture = home_posture(load_robot("five_bar"))
    solved = solve_exact(posture, progress=lambda done, most: steps.append(done))
    assert steps == list(range(1, solved.iterations + 1))


def test_every_load_of_a_curve_is_reported():
    said = []
    posture = home_posture(load_robot("hexapod"))
    deflection_curve(
        posture, 5, np.array([0.0, -10.0, -20.0]), exact=True,
        progress=lambda what, done, most: said.append(what),
    )  # fmt: skip
    # beside those that bracket what happens on the way
    assert set(said) >= {f"steps at load {load}" for load in (0, -10, -20)}
