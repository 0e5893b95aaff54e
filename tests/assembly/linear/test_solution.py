"""Solutions of many points: selection, iteration, and loads of each point."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from tests.robots_for_tests import coaxial_beams

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
