"""Templates for robot files with ``format = 2``, used by ``forcefit new``.

The letters in the name of a template denote the joints of a leg from the base to the
platform: revolute, prismatic, universal, spherical.  The first R or P joint is driven.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from forcefit.inputs.errors import BadInput, nearest, quoted

MOST_LEGS = 12
Vector = tuple[int, int, int]  # point [mm] or direction vector


@dataclass(frozen=True)
class Kind:
    """Template for a type of robot.

    Attributes:
        about: short description.
        legs: default number of legs.
        step: number of which the number of legs must be a multiple.
        platform: reference point of the platform [mm].
        body: function that returns the text of the legs for a number of legs.
    """

    about: str
    legs: int
    step: int
    platform: Vector
    body: Callable[[int], str]


def new_robot(name: str, kind: str, legs: int | None = None) -> str:
    """Return the text of a robot file, which can be changed to describe a new robot.

    Args:
        name: name of the robot.
        kind: key of :data:`KINDS`.
        legs: number of legs; None for the default number.

    Returns:
        Text of a valid file with bodies, joints and comments.

    Raises:
        BadInput: the type is unknown, or it does not support this number of legs.
    """
    if kind not in KINDS:
        raise BadInput(f"--kind: found {quoted(kind)}{nearest(kind, KINDS)}")
    model = KINDS[kind]
    legs = model.legs if legs is None else legs
    if legs < model.legs or legs > MOST_LEGS or legs % model.step:
        even = "" if model.step == 1 else f"a multiple of {model.step} "
        raise BadInput(
            f"--legs: found {legs}, expected {even}from {model.legs} to {MOST_LEGS} "
            f"for --kind {kind}"
        )
    at = _lengths(model.platform)
    return _HEAD.format(name=name, about=model.about, legs=legs, at=at) + (
        model.body(legs)
    )


_HEAD = """\
#:schema robot.schema.json
# For completion in text editors, run: forcefit schema robot > robot.schema.json
#
#   forcefit assembly solve {name}.toml --load fz=-100
#   forcefit assembly stiffness {name}.toml
#   forcefit assembly show {name}.toml --figure {name}.png
#
# Points and directions are in base axes in the home pose. Lengths are in m, or texts
# with a unit: "240 mm". Replace all numbers below by those of your robot.
format = 2
name = "{name}"
description = "{about}, {legs} legs"
platform = "platform"
platform_at = {at}           # reference point of the platform

[[body]]
name = "platform"
mass = 3.0                       # [kg]
centre = {at}

"""
_LINK = (
    "link = {{ beam = {{ radius = {radius} }}, young = 2.1e11, poisson = 0.3, "
    "density = 7800 }}"
)
_BALL = 'clearance = { ball = "5 um" }    # gap between ball and socket'
_BORE = 'clearance = { radial = "5 um", length = "20 mm", axial = "5 um" }'
_ROTARY = "drive_stiffness = 2e4            # N m/rad"
_LINEAR = "drive_stiffness = 2e7            # N/m"


def _lengths(point: Vector) -> str:
    """Return the text of a point in mm."""
    return "[" + ", ".join(f'"{x} mm"' if x else "0" for x in point) + "]"


def _direction(vector: Vector) -> str:
    """Return the text of a direction vector with small integer components."""
    x, y, z = (int(v) for v in np.array(vector) // np.gcd.reduce(vector))
    return f"[{x}, {y}, {z}]"


def _leg(name: str, count: int, comment: str = "") -> str:
    """Return the text that defines a leg and the number of its copies."""
    comment = comment or f"copies {name}1, {name}2, ... rotated about z"
    return (
        f'[[leg]]\nname = "{name}"                     # {comment}\n'
        f"repeat = {{ count = {count}, about = [0, 0, 1] }}\n\n"
    )


def _bodies(*names: str, **radii: str) -> str:
    """Return the text of the bodies of a leg; bodies with a radius are elastic."""
    text = ""
    for name in names:
        text += f'[[leg.body]]\nname = "{name}"\n'
        if name in radii:
            text += "# elastic beam between its two joints\n"
            text += _LINK.format(radius=f'"{radii[name]}"') + "\n"
        text += "\n"
    return text


def _joint(name: str, kind: str, between: str, at: Vector, *lines: str) -> str:
    """Return the text of a joint between two bodies of a leg."""
    first, second = between.split()
    more = "".join(f"{line}\n" for line in lines)
    return (
        f'[[leg.joint]]\nname = "{name}"\ntype = "{kind}"\n'
        f'between = ["{first}", "{second}"]\nat = {_lengths(at)}\n{more}\n'
    )


def _axis(vector: Vector, key: str = "axis", comment: str = "") -> str:
    """Return a line of text that specifies a direction."""
    line = f"{key} = {_direction(vector)}"
    return f"{line:<33}# {comment}" if comment else line


def _minus(a: Vector, b: Vector) -> Vector:
    """Return the difference a - b of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product of two vectors."""
    x, y, z = (int(v) for v in np.cross(a, b))
    return x, y, z


def _pairs(foot: Callable[[int], Vector], end: Callable[[int], Vector], legs: int,
           leg: Callable[[Vector, Vector], str]) -> str:  # fmt: skip
    """Return the text of two legs that are mirror images, and their copies."""
    text = ""
    for name, side in (("left", 1), ("right", -1)):
        text += _leg(name, legs // 2) + leg(foot(side), end(side))
    return text


def _ups(legs: int) -> str:
    """Return the text of the legs of a Gough platform."""

    def leg(a: Vector, b: Vector) -> str:
        along = _minus(b, a)
        level = _cross((0, 0, 1), along)
        return (
            _bodies("tube", "rod", rod="12 mm")
            + _joint("lower", "universal", "base tube", a,
                     _axis(level, "axis", "fixed to the base"),
                     _axis(_cross(along, level), "axis2", "fixed to the tube"))
            + _joint("slide", "prismatic", "tube rod", a, _axis(along),
                     "actuated = true", _LINEAR)
            + _joint("ball", "spherical", "rod platform", b, _BALL)
        )  # fmt: skip

    return _pairs(
        lambda side: (280, 60 * side, 0), lambda side: (100, 130 * side, 450), legs, leg
    )


def _rus(legs: int) -> str:
    """Return the text of legs with a crank and a rod."""

    def leg(a: Vector, b: Vector) -> str:
        elbow = a[0] + 120, a[1], a[2]
        along = _minus(b, elbow)
        second = _cross((0, 1, 0), along)
        return (
            _bodies("crank", "rod", crank="20 mm", rod="10 mm")
            + _joint("drive", "revolute", "base crank", a, _axis((0, 1, 0)),
                     "actuated = true", _ROTARY)
            + _joint("elbow", "universal", "crank rod", elbow,
                     _axis((0, 1, 0), "axis", "fixed to the crank"),
                     _axis(second, "axis2", "fixed to the rod"), _BORE)
            + _joint("ball", "spherical", "rod platform", b, _BALL)
        )  # fmt: skip

    return _pairs(
        lambda side: (200, 50 * side, 0), lambda side: (70, 110 * side, 400), legs, leg
    )


def _upu(legs: int) -> str:
    """Return the text of the legs of Tsai's translational 3-UPU robot."""
    a, b, y = (240, 0, 0), (80, 0, 450), (0, 1, 0)
    along = _minus(b, a)
    inner = _cross(along, y)
    return (
        _leg("leg", legs)
        + _bodies("tube", "rod", rod="15 mm")
        + _joint("lower", "universal", "base tube", a,
                 _axis(y, "axis", "fixed to the base; parallel to that of upper"),
                 _axis(inner, "axis2", "fixed to the tube"), _BORE)
        + _joint("slide", "prismatic", "tube rod", a, _axis(along),
                 "actuated = true", _LINEAR)
        + _joint("upper", "universal", "rod platform", b,
                 _axis(inner, "axis", "fixed to the rod"),
                 _axis(y, "axis2", "fixed to the platform"), _BORE)
    )  # fmt: skip


def _prs(legs: int) -> str:
    """Return the text of legs with a vertical slide, a hinge and a ball joint."""
    hinge, ball = (400, 0, 0), (250, 0, -700)
    return (
        _leg("leg", legs)
        + _bodies("carriage", "arm", arm="30 mm")
        + _joint("rail", "prismatic", "base carriage", hinge, _axis((0, 0, 1)),
                 "actuated = true", _LINEAR)
        + _joint("hinge", "revolute", "carriage arm", hinge, _axis((0, 1, 0)), _BORE)
        + _joint("ball", "spherical", "arm platform", ball, _BALL)
    )  # fmt: skip


def _rrr(legs: int) -> str:
    """Return the text of the legs of a robot that moves in the x-y plane."""
    z = _axis((0, 0, 1))
    return (
        _leg("leg", legs)
        + _bodies("near", "far", near="15 mm", far="12 mm")
        + _joint("drive", "revolute", "base near", (300, 0, 0), z, "actuated = true",
                 _ROTARY)
        + _joint("elbow", "revolute", "near far", (200, 120, 0), z, _BORE)
        + _joint("pin", "revolute", "far platform", (80, 0, 0), z, _BORE)
    )  # fmt: skip


def _delta(legs: int) -> str:
    """Return the text of arms with two parallel rods between ball joints."""
    elbow, end = (350, 0, -100), (50, 0, -600)
    text = (
        _leg("leg", legs)
        + _bodies("arm", "rod_a", "rod_b", rod_a="6 mm", rod_b="6 mm")
        + _joint("drive", "revolute", "base arm", (150, 0, 0), _axis((0, 1, 0)),
                 "actuated = true", _ROTARY)
    )  # fmt: skip
    for side, y in (("a", 50), ("b", -50)):
        for joint, between, (x, _, z) in (
            ("high", f"arm rod_{side}", elbow), ("low", f"rod_{side} platform", end)
        ):  # fmt: skip
            text += _joint(f"{side}_{joint}", "spherical", between, (x, y, z), _BALL)
    return text


KINDS: Mapping[str, Kind] = {
    "UPS": Kind("Gough platform, UPS", 6, 2, (0, 0, 450), _ups),
    "RUS": Kind("cranks and rods, RUS", 6, 2, (0, 0, 400), _rus),
    "UPU": Kind("translations, UPU after Tsai", 3, 1, (0, 0, 450), _upu),
    "PRS": Kind("two turns and a translation, PRS", 3, 1, (0, 0, -700), _prs),
    "RRR": Kind("in a plane, RRR", 3, 1, (0, 0, 0), _rrr),
    "delta": Kind("translations, R and two SS rods", 3, 1, (0, 0, -600), _delta),
}
