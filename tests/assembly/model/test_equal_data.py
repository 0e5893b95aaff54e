"""Equality of robots and of their links."""

import pickle
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.link_kinds import LibraryLink, MeshLink, MeshSolution
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots import BUILT_IN

K = np.diag([1e3, 1e3, 1e3, 1e5, 1e5, 1e5])


def made(**other):
    """Create a new robot in which all fields are set."""
    drive = Frame(
        "drive", joint="revolute", actuated=True, limits=(-1.0, 1.0),
        clearance=Clearance(radial=1e-4), tolerance=np.full(6, 1e-5), mass=2.0,
        inertia=np.diag([1.0, 1.0, 1.0]),
        joint_stiffness=np.diag([np.inf, np.inf, 1e4, np.inf, np.inf, np.inf]),
    )  # fmt: skip
    beam = BeamLink({"radius": 0.02}, 2e11, 0.3)
    tip = Frame("tip", "drive", translation=[0.3, 0, 0], link=beam)
    end = Frame("end", "tip", translation=[0.1, 0, 0], link=MatrixLink(K.copy()))
    wave = Function("tip", ("rx",), ("q.drive",), "waves", {"1.sine": 1e-4})
    given = {
        "name": "arm", "platform": "end", "frames": (drive, tip, end),
        "effects": {"encoder_offset": {"drive": 1e-3}}, "functions": (wave,),
        "learned_range": {"q.drive": (-1.0, 1.0)}, "diagnosis": {"rows": 12},
        "reference_point": (0.0, 0.0, 0.1), "remarks": ("a note",),
    }  # fmt: skip
    return Robot(**given | other)


OTHER = {
    "name": "leg", "platform": "tip", "closures": (("tip", "end"),),
    "description": "another", "effects": {"encoder_offset": {"drive": 2e-3}},
    "session_effects": {"Monday": {}}, "functions": (), "learned_range": {},
    "diagnosis": {"rows": 13}, "reference_point": None, "remarks": (),
}  # fmt: skip
OTHER_FRAME = {
    "translation": [0.3, 0, 1e-300], "rotation": [0, 0, 1e-9], "joint": "revolute",
    "geometric_error": [0, 0, 0, 0, 0, np.nextafter(0, 1)], "tolerance": np.zeros(6),
    "clearance": Clearance(), "joint_stiffness": K, "link": None, "mass": 1e-9,
    "centre_of_mass": [0, 0, 1e-9], "inertia": np.eye(3), "position": -0.0,
    "name": "knee", "parent": "base",
}  # fmt: skip


def test_robots_with_equal_data_have_equal_hashes():
    assert made() is not made()
    assert made() == made()
    assert hash(made()) == hash(made())
    assert {made(): "known"}[made()] == "known"
    assert made() != "arm"


def test_robots_with_equal_integer_and_float_are_equal():
    two = [Frame("a", mass=2, position=0), Frame("a", mass=2.0, position=0.0)]
    assert Robot("r", "a", (two[0],)) == Robot("r", "a", (two[1],))


@pytest.mark.parametrize("name", [f.name for f in fields(Robot) if f.name in OTHER])
def test_robots_that_differ_in_one_field_are_unequal(name):
    assert made(**{name: OTHER[name]}) != made()


@pytest.mark.parametrize("name", sorted(OTHER_FRAME))
def test_robots_that_differ_in_one_field_of_a_frame_are_unequal(name):
    frames = list(made().frames[1:])
    changed = replace(frames[0], **{name: OTHER_FRAME[name]})
    assert changed != frames[0]
    alone = [Robot("r", one.name, (replace(one, parent="base"),))
             for one in (frames[0], changed)]  # fmt: skip
    assert (alone[0] == alone[1]) is (name == "parent")


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_robot_read_from_its_file_equals_the_original(name, tmp_path):
    robot = ff.load_robot(name)
    ff.write_robot(robot, tmp_path / "robot.toml")
    assert ff.load_robot(tmp_path / "robot.toml") == robot
    assert ff.load_robot(name) == robot


def test_library_links_with_equal_keys_can_have_different_stiffness():
    """The file of the library is replaced between the two computations."""
    screws = []
    for factor in (1.0, 2.0):
        link = LibraryLink(Path("links.h5"), "arm", factor * np.linalg.inv(K))
        robot = Robot("r", "a", (Frame("a", translation=[0.1, 0, 0], link=link),))
        forced = solve_assembly(home_posture(robot), {"fz": 1.0})
        screws.append(forced.platform_screw[5])
    np.testing.assert_allclose(screws, [1e-5, 2e-5])


def test_pickled_robot_without_link_solution_is_unequal():
    """Finite-element solutions are not pickled."""
    solved = SimpleNamespace(link=SimpleNamespace(compliance=np.linalg.inv(K)))
    solution = MeshSolution(solved, 2e11, "abc", np.zeros((12, 12)))
    link = MeshLink(Path("a.stl"), "x", "y", 2e11, 0.3, solution=solution)
    robot = Robot("r", "a", (Frame("a", link=link),))
    again = Robot(
        "r", "a", (Frame("a", link=replace(link, solution=replace(solution))),)
    )
    assert again == robot
    assert pickle.loads(pickle.dumps(robot)) != robot


def test_equal_robots_are_equal_in_another_process(tmp_path):
    """Python hashes strings differently in each process."""
    robot = ff.load_robot("hexapod")
    hash(robot)
    (tmp_path / "robot").write_bytes(pickle.dumps(robot))
    code = (
        "import pickle, sys, forcefit as ff\n"
        "robot = pickle.load(open(sys.argv[1], 'rb'))\n"
        "assert {robot: 1} == {ff.load_robot('hexapod'): 1}"
    )
    subprocess.run([sys.executable, "-c", code, tmp_path / "robot"], check=True)


def test_joint_stiffness_given_by_its_diagonal_equals_the_matrix():
    diagonal = [np.inf, np.inf, 10.0, np.inf, np.inf, 2e5]
    short, full = (
        Frame("hinge", joint_stiffness=K) for K in (diagonal, np.diag(diagonal))
    )
    assert short == full
    with pytest.raises(ValueError, match=r"hinge.: joint_stiffness has shape \(3, 3\)"):
        Frame("hinge", joint_stiffness=[1.0, 2.0, 3.0])
