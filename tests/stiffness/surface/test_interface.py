"""Interfaces from text and tables."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from stiffness.surface.interface import parse_interface


@pytest.mark.parametrize(
    ("text", "kind", "radius"),
    [
        ("z=0.452", "plane", np.inf),
        (" x = -1e-3 ", "plane", np.inf),
        ("bore=0,0,0/0,2,0/0.01", "bore", 0.01),
        ("disc=0,0,0.1/0,0,1/0.02", "disc", 0.02),
        (
            {"bore": {"point": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.01}},
            "bore",
            0.01,
        ),
        ({"plane": {"point": [0, 0, 1], "normal": [0, 0, 3]}}, "plane", np.inf),
        ({"plane": {"point": [0, 0, 1], "normal": [0, 0, 1]}, "radius": 1}, "disc", 1),
    ],
)
def test_interfaces_as_people_write_them(text, kind, radius):
    interface = parse_interface(text)
    assert interface.kind == kind
    assert interface.radius == radius
    assert np.linalg.norm(interface.direction) == pytest.approx(1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("w=3", "--base: found 'w=3', expected"),
        ("z=nan", "found 'z=nan'"),
        ("bore=0,0,0/0,0,0/0.01", "bore direction is zero"),
        ("bore=0,0,0/0,1,0/-1", "radius = -1 must be > 0"),
        ("bore=0,0/0,1,0/1", "found 'bore"),
        (3, "found 3"),
        ({"bor": {}}, 'unknown key "bor"'),
        ({"bore": {"point": [0, 0], "axis": [0, 1, 0], "radius": 1}}, "point: found"),
        (
            {"bore": {"point": [0, 0, 0], "axis": [0, 1, 0]}},
            "bore.radius: found nothing",
        ),
        ({"plane": {"point": [0, 0, 0], "norml": [0, 1, 0]}}, '"normal"'),
    ],
)
def test_what_is_no_interface_is_refused(text, message):
    with pytest.raises(BadInput) as caught:
        parse_interface(text, "--base")
    assert message in str(caught.value)
    assert str(caught.value).startswith("--base: ")
