"""Rejection of arrays of wrong shape, type or memory order."""

import _datetime as datetime
import re

import numpy as np
import pytest

from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.kinematics import nominal
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.lanes import _robot
from forcefit.assembly.linear.robot_structure import structure_of
from forcefit.assembly.robots import load_robot

ROBOT = load_robot("five_bar")
N, K = len(ROBOT.frames), 3


def given():
    """Return valid arguments of (22) by name."""
    joints, structure = structure_of(ROBOT)
    nu, nq = joints.cones.shape[1], joints.free.shape[1]
    m, ny = 6 * len(ROBOT.closures), joints.elastic.shape[1]
    home = home_posture(ROBOT)
    return {
        "robot": _robot(structure), "T": np.array([home.transforms] * K),
        "errors": np.full((K, N, 6), 1e-4), "mismatch": np.zeros(K), "loads": None,
        "outcome": np.zeros(K, dtype=np.int64), "energy": np.zeros(K),
        "bound": np.zeros(K), "without_clearance": np.zeros(K), "work": np.zeros(K),
        "platform_screw": np.zeros((K, 6)), "clearances": np.zeros((K, nu)),
        "motions": np.zeros((K, nq)), "multipliers": np.zeros((K, m)),
        "residual": np.zeros(K), "elastic": np.zeros((K, ny)),
    }  # fmt: skip


@pytest.mark.parametrize("rows", [("errors",), ("T", "mismatch"), ("loads",)])
def test_arrays_of_one_row_apply_to_all_points(rows):
    loads = np.full((K, 2, N, 6), 2.0)
    right, shared = given() | {"loads": loads}, given() | {"loads": loads}
    kernels.assemble_all(**right)
    kernels.assemble_all(**shared | {name: shared[name][:1] for name in rows})
    assert np.array_equal(shared["energy"], right["energy"])


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


@pytest.mark.parametrize("name", [name for name in given() if name != "robot"])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda array: array[..., None],
        lambda array: array[None],
        lambda array: array.astype(np.float32),
        lambda array: np.repeat(array, 2, axis=0)[::2],  # not contiguous
        lambda array: array.tolist(),
        lambda array: "none",
    ],
)
def test_wrong_array_of_assemble_all_is_rejected(name, spoil):
    right = given()
    array = np.zeros((K, 2, N, 6)) if name == "loads" else right[name]
    with pytest.raises(ValueError, match=rf"^{name}: .*, expected .*of shape \("):
        kernels.assemble_all(**right | {name: spoil(array)})


@pytest.mark.parametrize("name", [n for n in given() if n not in {"robot", "T"}])
def test_array_with_a_wrong_number_of_points_is_rejected(name):
    right = given()
    array = np.zeros((K, 2, N, 6)) if name == "loads" else right[name]
    with pytest.raises(ValueError, match=rf"^{name}: .* \({K - 1},.* \({K},"):
        kernels.assemble_all(**right | {name: array[:-1]})


@pytest.mark.parametrize("name", ["outcome", "energy", "elastic"])
def test_read_only_output_array_is_rejected(name):
    wrong = given()
    with pytest.raises(ValueError, match=rf"^{name}: .*read-only, expected writable"):
        kernels.assemble_all(**wrong | {name: read_only(wrong[name])})


INDEXED = ("pattern_of", "spring_frame", "spring_order", "of_joint", "group_pattern",
           "cone_frame", "cone_axis", "free_frame", "free_axis")  # fmt: skip


@pytest.mark.parametrize("name", INDEXED)
@pytest.mark.parametrize("index", [-1, 10**6])
def test_index_out_of_range_is_rejected(name, index):
    structure = structure_of(ROBOT)[1]
    wrong = getattr(structure, name).copy()
    wrong[-1] = index
    with pytest.raises(ValueError, match=re.escape(f"{name}[{len(wrong) - 1}] is ")):
        kernels.Robot(structure._replace(**{name: wrong}))


@pytest.mark.parametrize("name", ["groups", "starts"])
@pytest.mark.parametrize("at", [0, -1])
def test_inconsistent_groups_are_rejected(name, at):
    structure = structure_of(ROBOT)[1]
    wrong = getattr(structure, name).copy()
    wrong[at] = 10**6
    with pytest.raises(ValueError, match=rf"^{name}: expected numbers that begin at 0"):
        kernels.Robot(structure._replace(**{name: wrong}))


@pytest.mark.parametrize(
    ("name", "wrong"),
    [("parents", [[0, 1]]), ("kinds", [7]), ("pairs", [[0, 99]]), ("moves", [[99, 1]]),
     ("groups", [1]), ("fixed", [1.0])],
)  # fmt: skip
def test_wrong_array_of_a_tree_is_rejected(name, wrong):
    fields = nominal._tree(ROBOT)
    kernels.Tree(**fields)
    wrong = np.array(wrong, dtype=np.asarray(fields[name]).dtype)
    if wrong.shape[1:] == fields[name].shape[1:]:
        wrong = np.concatenate([wrong, fields[name][1:]])
    with pytest.raises(ValueError, match=rf"^{name}\b"):
        kernels.Tree(**fields | {name: wrong})


@pytest.mark.parametrize("name", ["G", "h", "d", "H", "k", "starts", "u", "y"])
def test_wrong_array_of_interior_point_is_rejected(name, rng):
    right = {
        "G": rng.normal(size=(3, 5)), "h": np.ones(3), "d": np.ones(5),
        "H": rng.normal(size=(1, 5)), "k": np.zeros(1),
        "starts": np.array([0, 2, 3, 5]), "tolerance": 1e-9,
        "u": np.zeros(5), "y": np.zeros(4),
    }  # fmt: skip
    kernels.interior_point(**right)
    assert right["u"].any()
    shorter = right | {name: right[name][:-1].copy()}
    # Messages about wrong shapes of h, d and k contain the name of their matrix.
    named = {"h": "G", "d": "G", "k": "H"}.get(name, name)
    with pytest.raises(ValueError, match=rf"^{named}\b"):
        kernels.interior_point(**shorter)


def farther(rng):
    """Return valid arguments of farthest points by name."""
    d = rng.normal(size=(2, 5))
    return {
        "H": rng.normal(size=(1, 5)), "starts": np.array([0, 2, 3, 5]),
        "d": d / np.linalg.norm(d, axis=1)[:, None], "right": np.zeros((2, 1)),
        "tolerance": np.full(2, 1e-9), "points": np.zeros((2, 5)),
        "multipliers": np.zeros((2, 1)), "solved": np.zeros(2, dtype=np.int64),
    }  # fmt: skip


def walk(rng):
    """Return valid arguments of a random walk."""
    M = rng.normal(size=(5, 3))
    return {
        "axes": M, "gram": M @ M.T, "starts": np.array([0, 2, 3, 5]),
        "to_screw": np.ones((6, 5)), "every": 2, "random": rng.bit_generator.capsule,
        "u": np.zeros(5), "trace": np.zeros((2, 6)),
    }  # fmt: skip


CALLS = {"farthest_points": farther, "billiard_walk": walk}


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (call, name)
        for call, arguments in CALLS.items()
        for name, value in arguments(np.random.default_rng(0)).items()
        if isinstance(value, np.ndarray)
    ],
)
def test_wrong_array_of_other_kernels_is_rejected(call, name, rng):
    right = CALLS[call](rng)
    getattr(kernels, call)(**right)
    with pytest.raises(ValueError, match=rf"^{name}: .*expected"):
        getattr(kernels, call)(**right | {name: right[name].astype(np.float32)})


@pytest.mark.parametrize("random", ["rng", "datetime"])
def test_object_other_than_a_bit_generator_is_rejected(rng, random):
    """The object must be a NumPy bit generator."""
    given = {"rng": rng, "datetime": datetime.datetime_CAPI}
    with pytest.raises((TypeError, ValueError)):
        kernels.billiard_walk(**walk(rng) | {"random": given[random]})
