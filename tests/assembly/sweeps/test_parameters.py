"""Numbers in a robot file that are selected by paths."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, Frame, MatrixLink, Robot
from forcefit.assembly.robots import BUILT_IN, load_robot
from forcefit.assembly.sweeps.identity import robot_hash
from forcefit.assembly.sweeps.parameters import design_of, load_design, unit_of


@pytest.fixture(scope="module")
def design():
    return load_design("irsbot2")


@pytest.mark.parametrize("name", BUILT_IN)
def test_design_without_changes_equals_the_robot(name):
    assert robot_hash(load_design(name).robot({})) == robot_hash(load_robot(name))


def test_path_changes_only_its_number(design):
    path = "leg1.link_a.link.beam.radius"
    changed, robot = design.robot({path: 0.031}), load_robot("irsbot2")
    link = robot.frame("leg1.link_a").link
    expected = replace(link, section={"radius": 0.031})
    assert robot_hash(changed) == robot_hash(
        robot.with_links({"leg1.link_a": expected})
    )


def test_path_without_a_leg_changes_every_leg(design):
    robot = design.robot({"link_b.link.young": 7e10})
    assert [robot.frame(f"leg{i}.link_b").link.young for i in (1, 2)] == [7e10, 7e10]


@pytest.mark.parametrize(
    ("path", "value", "read"),
    [
        ("leg1.link_a.geometric_error.tx", 1e-4,
         lambda r: r.frame("leg1.link_a").geometric_error[3]),
        ("leg1.link_a.geometric_error.rz", 1e-4,
         lambda r: r.frame("leg1.link_a").geometric_error[2]),
        ("leg2.link_a.clearance.tilt", 1e-3,
         lambda r: r.frame("leg2.link_a").clearance.tilt),
        ("leg1.elbow_a_first.joint_stiffness.rz", 2.5,
         lambda r: r.frame("leg1.elbow_a_first").joint_stiffness[2, 2]),
        ("leg1.tip.mass", 0.3, lambda r: r.frame("leg1.tip").mass),
        ("leg1.tip.centre_of_mass.y", 0.01,
         lambda r: r.frame("leg1.tip").centre_of_mass[1]),
    ],
)  # fmt: skip
def test_every_kind_of_number_has_a_path(design, path, value, read):
    assert read(design.robot({path: value})) == value


def test_product_of_inertia_has_a_path():
    """The path exists only if the file contains moments of inertia."""
    tip = Frame("tip", mass=1.0, inertia=np.diag([1.0, 2.0, 2.5]))
    design = design_of(Robot("ball", "tip", (tip,)))
    assert design.robot({"tip.inertia.xz": 0.3}).frame("tip").inertia[2, 0] == 0.3
    assert unit_of("tip.inertia.xz") == "kg m^2"


def test_path_in_a_symmetric_matrix_changes_both_entries():
    robot = load_robot("four_bar")
    K = np.diag([1e3, 1e3, 1e3, 1e6, 1e6, 1e6])
    design = design_of(robot.with_links({"middle": MatrixLink(K)}))
    changed = design.robot({"middle.link.stiffness.rx.ty": 5.0})
    K = changed.frame("middle").link.stiffness
    assert K[0, 4] == K[4, 0] == 5.0


def test_denavit_hartenberg_parameters_can_be_changed(tmp_path):
    """The number d in ``dh`` is changed before conversion to a translation."""
    text = """
platform = "tip"
frame = [
    { name = "arm", parent = "base", joint = "revolute", actuated = true },
    { name = "tip", parent = "arm", dh = { theta = 0, d = 0.2, a = 0.1, alpha = 0 } },
]
"""
    (tmp_path / "r.toml").write_text(text)
    design = load_design(tmp_path / "r.toml")
    assert design.robot({"tip.dh.d": 0.3}).frame("tip").translation[2] == 0.3
    with pytest.raises(BadInput, match='no number "tip.translation.x"'):
        design.robot({"tip.translation.x": 0.3})


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"leg1.link_a.link.beam.raduis": 1.0},
         'irsbot2: no number "leg1.link_a.link.beam.raduis"; did you mean '
         '"leg1.link_a.link.beam.radius"?'),
        ({"leg1.link_a.parent": 1.0}, 'irsbot2: no number "leg1.link_a.parent"'),
        ({"link_a.link.beam.radius": -1.0},
         'irsbot2: frame "leg1.link_a".link.beam.radius: found -1.0, expected a finite '
         "number > 0"),
    ],
)  # fmt: skip
def test_invalid_path_or_number_is_rejected_with_one_message(design, values, message):
    with pytest.raises(BadInput) as error:
        design.robot(values)
    assert str(error.value).startswith(message)


def test_numbers_that_prevent_loop_closure_are_rejected(design):
    """A parallelogram does not close if a frame is displaced by 1 mm."""
    values = {"leg1.elbow_a.translation.y": 0.2}
    design.check(values)  # valid in a robot file
    with pytest.raises(BadInput, match="is open in the home pose"):
        design.robot(values)
