"""Solutions of many points: closed forms, selection, certificates, refusals."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from tests.robots_for_tests import assemble_at, coaxial_beams

K = 1e6


def pins(gaps):
    """A spring that ends in a pin of 1e-4 m, and a gap along x in each row."""
    frames = (
        Frame("arm", translation=[0.5, 0, 0], link=MatrixLink(K * np.eye(6))),
        Frame("pin", "arm", clearance=Clearance(radial=1e-4)),
        Frame("end", "pin"),
        Frame("wall", translation=[0.5, 0, 0]),
    )
    home = home_posture(Robot("pins", "end", frames, (("end", "wall"),)))
    errors = np.zeros((len(gaps), 4, 6))
    errors[:, 3, 3] = gaps
    return home, errors


def rigid_pins(gaps):
    """The same without the spring: a gap beyond the clearance cannot be closed."""
    home, errors = pins(gaps)
    frames = (Frame("arm", translation=[0.5, 0, 0]), *home.robot.frames[1:])
    robot = Robot("rigid", "end", frames, (("end", "wall"),))
    return home_posture(robot), errors


def test_points_can_be_selected_by_mask_slice_and_repeated_indices():
    """The energy is K (gap - 1e-4)^2 / 2 beyond the clearance, by hand."""
    gaps = np.array([0.5e-4, 2e-4, 3e-4, 1.5e-4])
    home, errors = pins(gaps)
    many = solve_assembly(home, errors=errors)
    by_hand = K * np.maximum(gaps - 1e-4, 0.0) ** 2 / 2
    assert many.energy == pytest.approx(by_hand, rel=1e-6, abs=1e-15)
    for rows in (gaps > 1e-4, slice(1, 3), [2, 2, 0]):
        some = many[rows]
        assert some.energy.tolist() == many.energy[rows].tolist()
        assert np.array_equal(some.wrenches, many.wrenches[rows])
        assert np.array_equal(some[0].wrenches, some.wrenches[0])
    assert many[-1].energy == many.energy[3]
    with pytest.raises(IndexError):
        many[4]


def test_point_without_solution_keeps_its_status_when_selected():
    home, errors = rigid_pins(np.array([0.5e-4, 2e-4, 0.1e-4]))
    many = solve_assembly(home, errors=errors)
    assert many.status.tolist() == ["ok", "cannot assemble", "ok"]
    twice = many[[1, 0, 1]]
    for some, i in ((many, 1), (twice, 0), (twice, 2)):
        assert np.isnan(some.energy[i])
        with pytest.raises(CannotAssemble, match="neither a spring nor a clearance"):
            some[i]
    assert twice[1].energy == many[0].energy == 0.0


def test_solution_of_a_single_point_has_no_length():
    home, _ = pins([0.0])
    with pytest.raises(TypeError, match="Assembly of one point has no length"):
        len(solve_assembly(home))


@pytest.mark.parametrize("loaded", [(1, 0), (0, 1), (1, 1), (0, 0)])
def test_loaded_and_unloaded_points_keep_their_own_errors(loaded):
    """Stored: K g^2 / 4 of the gap and F^2 / 4 K of the load, which are independent."""
    sets = np.zeros((2, 6, 6))
    sets[:, 2, 3] = 1e-4, 3e-4
    at = home_posture(coaxial_beams(np.zeros(6), (K, K)))
    forces = np.array(loaded)[:, None] * np.array([0.0, 0, 0, 100.0, 0, 0])
    found = solve_assembly([at] * 2, forces, errors=sets)
    expected = K * sets[:, 2, 3] ** 2 / 4 + forces[:, 3] ** 2 / (4 * K)
    assert found.energy == pytest.approx(expected, rel=1e-9)
    assert found.loaded.tolist() == [bool(one) for one in loaded]
    for one, errors in zip(found, sets, strict=True):
        assert (one.posture.robot.errors == errors).all()


def test_redundant_free_motions_have_the_least_norm():
    """Two pins on one axis share its rotation: half each, as by the reference."""
    gap = [1e-3, 0, 2e-3, 1e-4, 0, 0]
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(1e5 * np.eye(6))),
        Frame("pin", "one", joint="revolute"),
        Frame("mid", "pin"),
        Frame("second", "mid", [0, 0, 0.1], joint="revolute"),
        Frame("end", "second", [0, 0, -0.1]),
        Frame("wall", translation=[0.5, 0, 0], geometric_error=gap),
    )
    robot = Robot("pins", "mid", frames, (("end", "wall"),))
    home = home_posture(robot)
    batch = assemble_at(robot, home.transforms[None])
    one = solve_assembly(home, method="reference")
    assert batch.method[0] == "compiled"
    assert batch.platform_screw[0] == pytest.approx(one.platform_screw, abs=1e-14)
    # the pin below the platform turns half the 2e-3 rad about their common axis
    assert batch.platform_screw[0, 2] == pytest.approx(1e-3, rel=1e-9)


def test_energy_of_a_stiff_spring_in_series_with_a_soft_one_is_accurate():
    """1 and 1e-8 rad/(N m) about one axis, twice 1e-8 across it."""
    soft = np.diag([1.0, 1e8, 1e8, 1e8, 1e8, 1e8])
    gap = np.array([1e-2, 1e-4, 0, 0, 0, 0])
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(soft)),
        Frame("end", "one", rotation=[0, 0, 0.3], link=MatrixLink(1e8 * np.eye(6))),
        Frame("wall", translation=[0.5, 0, 0], rotation=[0, 0, 0.3],
              geometric_error=gap),
    )  # fmt: skip
    robot = Robot("two", "end", frames, (("end", "wall"),))
    batch = assemble_at(robot, home_posture(robot).transforms[None])
    turned = np.array([
        gap[0] * np.cos(0.3) - gap[1] * np.sin(0.3),
        gap[0] * np.sin(0.3) + gap[1] * np.cos(0.3),
    ])
    # by hand: 1 + 1e-8 about the soft axis, 2e-8 across
    by_hand = turned[0] ** 2 / (1 + 1e-8) / 2 + turned[1] ** 2 / 2e-8 / 2
    assert batch.energy[0] == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "errors", "message"),
    [
        ((2, 5, 4, 4), None, r"transforms of shape \(2, 5, 4, 4\)"),
        ((2, 6, 4, 4), (3, 6, 6), r"errors of shape \(3, 6, 6\), expected"),
        ((2, 6, 3, 4), None, r"transforms of shape \(2, 6, 3, 4\)"),
    ],
)
def test_transforms_or_errors_of_a_wrong_shape_are_refused(shape, errors, message):
    robot = coaxial_beams(np.zeros(6))
    given = None if errors is None else np.zeros(errors)
    with pytest.raises(ValueError, match=message):
        assemble_at(robot, np.zeros(shape), given)


def test_values_that_are_not_finite_are_refused():
    robot = coaxial_beams(np.zeros(6))
    T = home_posture(robot).transforms[None].copy()
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T, np.full((6, 6), np.nan))
    T[0, 0, 0, 3] = np.inf
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T)


def test_empty_list_of_postures_gives_an_empty_solution():
    robot = coaxial_beams(np.zeros(6))
    assert len(assemble_at(robot, np.zeros((0, 6, 4, 4))).energy) == 0
