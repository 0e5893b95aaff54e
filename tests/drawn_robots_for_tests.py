"""Built-in robots, described by bodies and joints in robot files of format 2.

The points and axes refer to the home pose and are computed from the dimensions.
"""

import math

import numpy as np

from forcefit.assembly.robots.delta import AZIMUTHS, DeltaParameters, drive_angle
from forcefit.assembly.robots.five_bar import FiveBarParameters
from forcefit.assembly.robots.hexapod import HexapodParameters, points
from forcefit.assembly.robots.planar import arm_angle


def row(values):
    """Format numbers as a TOML array."""
    return "[" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "]"


def table(kind, **keys):
    """Format a TOML table ``[[kind]]`` with the given keys."""
    lines = [f"[[{kind}]]"]
    for key, value in keys.items():
        if isinstance(value, np.ndarray):
            text = row(value)
        elif isinstance(value, bool):
            text = str(value).lower()
        elif isinstance(value, str) and not value.startswith(("[", "{")):
            text = f'"{value}"'
        elif isinstance(value, str):
            text = value
        elif isinstance(value, tuple):
            text = "[" + ", ".join(f'"{v}"' for v in value) + "]"
        else:
            text = repr(value)
        lines.append(f"{key} = {text}")
    return "\n".join(lines) + "\n"


def head(name, platform, at):
    return f'format = 2\nname = "{name}"\nplatform = "{platform}"\n' + (
        f"platform_at = {row(at)}\n"
    )


def beam(link, up=None):
    """Format the value of the key ``link`` of a body."""
    section = ", ".join(f"{k} = {v!r}" for k, v in link.section.items())
    if up is not None:
        section += f", up = {row(up)}"
    density = "" if link.density is None else f", density = {link.density!r}"
    if link.theory != "timoshenko":
        section += f', theory = "{link.theory}"'
    return (
        f"{{ beam = {{ {section} }}, young = {link.young!r}, "
        f"poisson = {link.poisson!r}{density} }}"
    )


def bounds(clearance):
    """Format the value of the key ``clearance`` of a joint."""
    given = {k: v for k, v in vars(clearance).items() if v is not None}
    return "{ " + ", ".join(f"{k} = {v!r}" for k, v in given.items()) + " }"


def _flat(point):
    return np.array([*point, 0.0])


def _planar_leg(kind, foot, angle, tip, leg, robot_joints=""):
    """Return the TOML tables of a planar leg with a drive, an elbow and two beams."""
    elbow = foot + leg.near * np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-math.sin(angle), math.cos(angle), 0.0])
    along = (tip - elbow) / np.linalg.norm(tip - elbow)
    z, x = np.array([0.0, 0.0, 1.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
    return (
        table(f"{kind}.body", name="near", link=beam(leg.link, across))
        + table(f"{kind}.body", name="far",
                link=beam(leg.link, np.array([-along[1], along[0], 0.0])))
        + table(f"{kind}.joint", name="drive", type="revolute",
                between=("base", "near"), at=_flat(foot), axis=z,
                axis2=np.array([1.0, 0.0, 0.0]), actuated=True, position=float(angle),
                drive_stiffness=leg.drive)
        + table(f"{kind}.joint", name="elbow", type="revolute",
                between=("near", "far"), at=_flat(elbow), axis=z, axis2=x,
                clearance=bounds(leg.clearance))
    )  # fmt: skip


def drawn_five_bar():
    P = FiveBarParameters()
    tip = np.array(P.home)
    text = head("five_bar", "right.far", _flat(tip))
    for name, side in (("left", 1), ("right", -1)):
        foot = np.array([-side * P.base / 2, 0.0])
        angle = arm_angle("five_bar", foot, tip, P.leg.near, P.leg.far, side)
        text += table("leg", name=name) + _planar_leg("leg", foot, angle, tip, P.leg)
    return text + table(
        "joint", name="pin", type="revolute", between=("left.far", "right.far"),
        at=_flat(tip), axis=np.array([0.0, 0.0, 1.0]),
        clearance=bounds(P.leg.clearance),
    )  # fmt: skip


def drawn_hexapod():
    P = HexapodParameters()
    up = np.array([0.0, 0.0, P.height])
    text = head("hexapod", "platform", up) + table("body", name="platform")
    tube = (
        f"{{ beam = {{ radius = {P.radius!r}, inner_radius = {P.inner_radius!r} }}, "
        f"young = {P.young!r}, poisson = {P.poisson!r}, density = {P.density!r} }}"
    )
    for number, (a, b) in enumerate(zip(*points(), strict=True), 1):
        b = b + up
        length = float(np.linalg.norm(b - a))
        along = (b - a) / length
        first = np.cross([0.0, 0.0, 1.0], along)
        second = np.cross(along, first)
        text += (
            table("leg", name=f"leg{number}")
            + table("leg.body", name="tube")
            + table("leg.body", name="rod", link=tube)
            + table("leg.joint", name="cardan", type="universal",
                    between=("base", "tube"), at=a, axis=first, axis2=second,
                    clearance=f"[{{}}, {bounds(P.cardan)}]")
            + table("leg.joint", name="strut", type="prismatic",
                    between=("tube", "rod"), at=a, axis=along, axis2=first,
                    actuated=True, position=length, drive_stiffness=P.drive)
            + table("leg.joint", name="ball", type="spherical",
                    between=("rod", "platform"), at=b, axis=along, axis2=first,
                    clearance=bounds(P.ball))
        )  # fmt: skip
    return text


def drawn_delta():
    """Return a robot file of a Delta robot whose legs are copies of one leg."""
    P = DeltaParameters()
    home = np.array([0.0, 0.0, P.home])
    angle = drive_angle(P, AZIMUTHS[0], home)
    c, s = math.cos(AZIMUTHS[0]), math.sin(AZIMUTHS[0])
    out, across = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
    arm = math.cos(angle) * out - math.sin(angle) * np.array([0.0, 0.0, 1.0])
    foot = P.base_radius * out
    elbow = foot + P.arm * arm
    text = head("delta", "platform", home) + table("body", name="platform")
    text += table("leg", name="leg", repeat="{ count = 3, about = [0, 0, 1] }")
    text += table("leg.body", name="arm", link=beam(P.arm_link))
    text += table("leg.body", name="bar")
    text += table("leg.joint", name="drive", type="revolute", between=("base", "arm"),
                  at=foot, axis=across, axis2=out, actuated=True, position=float(angle),
                  drive_stiffness=P.drive)  # fmt: skip
    text += table("leg.joint", name="elbow", type="fixed", between=("arm", "bar"),
                  at=elbow)  # fmt: skip
    for name, sign in (("a", 1.0), ("b", -1.0)):
        aside = sign * P.rod_distance / 2 * across
        near, far = elbow + aside, home + P.platform_radius * out + aside
        along = (far - near) / np.linalg.norm(far - near)
        third = np.cross(along, across)
        text += table("leg.body", name=name, link=beam(P.rod_link))
        text += table("leg.joint", name=f"{name}_high", type="spherical",
                      between=("bar", name), at=near, axis=np.cross(across, third),
                      axis2=across, clearance=bounds(P.ball))  # fmt: skip
        text += table("leg.joint", name=f"{name}_low", type="spherical",
                      between=(name, "platform"), at=far, axis=third, axis2=along,
                      clearance=bounds(P.ball))  # fmt: skip
    return text
