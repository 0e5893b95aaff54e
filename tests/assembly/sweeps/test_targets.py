"""Grids and tables of postures."""

import numpy as np
import pytest

from forcefit import BadInput, load_robot
from forcefit.assembly.sweeps.targets import (
    goals_of,
    grid_targets,
    parse_grid,
    read_targets,
)


@pytest.fixture(scope="module")
def robot():
    return load_robot("irsbot2")


def test_grid_points_are_in_c_order(robot):
    targets = grid_targets(parse_grid("tx=0:0.2:0.1,tz=-0.5:-0.4:0.1"))
    rows = targets.at(np.arange(6))
    assert targets.shape == (3, 2)
    assert rows[1] == pytest.approx([0.0, -0.4])
    assert rows[4] == pytest.approx([0.2, -0.5])
    goals = goals_of(targets.names, robot, rows)
    assert np.isnan(goals[:, [1, 3, 4, 5]]).all()
    assert goals[4, [0, 2]] == pytest.approx([0.2, -0.5])


def test_drives_without_a_grid_axis_have_their_default_position(robot):
    targets = grid_targets(parse_grid("q.leg1.drive=0:1:0.5", robot))
    goals = goals_of(targets.names, robot, targets.at(np.arange(3)))
    one, other = robot.index("leg1.drive"), robot.index("leg2.drive")
    assert goals[:, one].tolist() == [0.0, 0.5, 1.0]
    assert (goals[:, other] == robot.positions[other]).all()
    assert np.isnan(np.delete(goals, [one, other], axis=1)).all()


def test_table_of_postures_is_read_in_order(robot, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("\ufeffid,pose.tx, pose.tz\r\nb,0.1,-0.5\r\n\r\na,0.2,-0.4\r\n")
    targets = read_targets(path, robot)
    assert (targets.dims, targets.shape) == (("posture",), (2,))
    assert (targets.names, targets.labels) == (("tx", "tz"), ("b", "a"))
    assert targets.at(np.array([1, 0])).tolist() == [[0.2, -0.4], [0.1, -0.5]]
    path.write_text("q.leg1.drive\n0.5\n0.25\n")
    targets = read_targets(path, robot)
    assert (targets.names, targets.labels) == (("q.leg1.drive",), ("1", "2"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "found nothing; expected a header and a row for each posture"),
        ("pose.tx\n", "found only a header; expected a header and a row"),
        ("pose.tx,pose.ux\n1,2\n", 'line 1: unknown column "pose.ux"'),
        ("q.leg1.drve\n1\n", 'did you mean "q.leg1.drive"?'),
        ("q.leg1.elbow\n1\n", 'unknown column "q.leg1.elbow"'),
        ("pose.tx,q.leg1.drive\n1,2\n",
         'line 1: found "tx" and "q.leg1.drive"; expected a pose or joints'),
        ("pose.tx,tx\n1,2\n", 'line 1: a column is given twice: "tx"'),
        ("id\n1\n", "line 1: found no posture; expected pose.tx, .. or q.*"),
        ("pose.tx\n1\n2,3\n", "line 3: found 2 cells, expected 1 as in the header"),
        ("pose.tx\n1\nnan\n", 'line 3, pose.tx: found "nan", expected a finite number'),
        ("id,pose.tx\na,1\na,2\n", 'id: found "a" twice; expected unique ids'),
        ("pose.tx\n1\n" + "0" * 200_000, "line 3: not CSV: field larger than"),
    ],
)  # fmt: skip
def test_invalid_table_of_postures_is_rejected_with_one_message(
    robot, tmp_path, text, message
):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    with pytest.raises(BadInput) as error:
        read_targets(path, robot)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("tx=0:1:0.25", [0, 0.25, 0.5, 0.75, 1.0]),
        ("tx=0:1:0.3", [0, 0.3, 0.6, 0.9]),  # the end is not included
        ("tx=-0.2:0.2:0.1", [-0.2, -0.1, 0, 0.1, 0.2]),  # the end is included
        ("tx=0.3:0.1:-0.1", [0.3, 0.2, 0.1]),
        ("tx=0.5", [0.5]),
    ],
)
def test_grid_includes_both_ends_if_the_step_fits(text, values):
    assert parse_grid(text)["tx"] == pytest.approx(values, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tx=0:1", 'grid tx: found "0:1", expected START:STOP:STEP or one number'),
        ("tx=a:b:c", 'grid tx: found "a:b:c", expected START:STOP:STEP'),
        ("tx=0:nan:1", 'grid tx: found "0:nan:1", expected'),
        ("tx=0:1:-0.1", "grid tx: found a step of -0.1 that does not lead from"),
        ("tx=0:1:0", "grid tx: found a step of 0 that does not lead from"),
        ("x=0:1:0.1", 'grid: unknown pose component "x"'),
        ("tx=0,tx=1", 'grid: "tx" is given twice'),
        ("tx=0:1:1e-9", "grid tx: 1e+09 points, which are too many; is the step"),
        ("tx=0:1:1e-4,ty=0:1:1e-4", "grid: more than 10000000 points"),
        ("", 'grid: unknown pose component ""'),
        ("tx=0,q.leg1.drive=0",
         'grid: found "tx" and "q.leg1.drive"; expected a pose'),
        ("q.leg1.drove=0", 'grid: unknown pose component "q.leg1.drove"; did you mean'),
        ("q.leg1.elbow=0", 'grid: unknown pose component "q.leg1.elbow"'),
    ],
)  # fmt: skip
def test_invalid_grid_is_rejected_with_one_message(robot, text, message):
    with pytest.raises(BadInput) as error:
        parse_grid(text, robot)
    assert str(error.value).startswith(message)
