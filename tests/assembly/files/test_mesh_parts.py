"""Mesh links that consist of different materials."""

from dataclasses import replace
from pathlib import Path

from forcefit.assembly.effects.modulus_scale import MODULUS_SCALE
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.model.robot import Frame, MeshLink, Robot
from forcefit.stiffness.fem.part_text import parse_part

PARTS = ("solid=end a+end_b/young=2.1e11,poisson=0.3", "z=0..0.1/young=1e9,poisson=0.3")


def arm(parts=PARTS):
    link = MeshLink(Path("/arm.step#*"), "z=0", "z=1", 7e10, 0.3, parts=parts)
    return Robot("one", "arm", (Frame("arm", translation=[0, 0, 1], link=link),))


def test_modulus_scale_multiplies_modulus_of_each_material():
    conditions = as_declared(home_posture(arm()))
    link = MODULUS_SCALE.apply(conditions, {"arm": 2.0}).robot.frame("arm").link
    assert link.young == 1.4e11
    found = [parse_part("parts", text) for text in link.parts]
    assert [part.E for part in found] == [4.2e11, 2e9]
    assert replace(found[0], E=2.1e11).solid == "end a+end_b"
