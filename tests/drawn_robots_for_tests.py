"""Built-in robots and others of the literature as files of ``format = 2``.

The numbers are points and axes of the home pose, from the robots' dimensions.
"""

import math

import numpy as np

from forcefit.assembly.robots.delta import AZIMUTHS, DeltaParameters, drive_angle
from forcefit.assembly.robots.five_bar import FiveBarParameters
from forcefit.assembly.robots.hexapod import HexapodParameters, points
from forcefit.assembly.robots.planar import arm_angle
from forcefit.assembly.robots.three_rrr import ThreeRRRParameters
from forcefit.stiffness.screws import UNIT_VECTORS, rotation_matrix, transform


def row(values):
    """A TOML array of numbers."""
    return "[" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "]"


def table(kind, **keys):
    """``[[kind]]`` with its keys; arrays become lists, ``_from`` is ``from``."""
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
    """The ``link`` of a beam of the library."""
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
    """The ``clearance`` of a joint."""
    given = {k: v for k, v in vars(clearance).items() if v is not None}
    return "{ " + ", ".join(f"{k} = {v!r}" for k, v in given.items()) + " }"


def _flat(point):
    return np.array([*point, 0.0])


def _planar_leg(kind, foot, angle, tip, leg, robot_joints=""):
    """Drive, elbow and two elastic arms whose beams' height is across, in the plane."""
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


def drawn_three_rrr():
    """One leg and its copies; a drive's coordinate is that of the first leg in all."""
    P = ThreeRRRParameters()
    foot, end = P.feet()[0], P.corners()[0] + P.home
    angle = arm_angle("3rrr", foot, end, P.leg.near, P.leg.far, side=1)
    text = head("3rrr", "platform", _flat(P.home)) + table("body", name="platform")
    text += table("leg", name="leg", repeat="{ count = 3, about = [0, 0, 1] }")
    text += _planar_leg("leg", foot, angle, end, P.leg)
    return text + table(
        "leg.joint", name="pin", type="revolute", between=("far", "platform"),
        at=_flat(end), axis=np.array([0.0, 0.0, 1.0]),
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
    """A leg and its copies: arm, bar across its end, two rods between balls."""
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


def drawn_prs():
    """A 3-PRS head of rails, hinged legs and balls."""
    angle = 1.7721542475852274
    hinge = np.array([0.4, 0.0, 0.0])
    ball = hinge + 0.75 * np.array([math.cos(angle), 0.0, -math.sin(angle)])
    tip = ball + [-0.25, 0.0, -0.2]
    x, y, z = np.eye(3)
    text = head("prs_head", "platform", tip)
    text += table("body", name="platform", mass=45.0, centre=tip + 0.12 * z)
    text += table("leg", name="leg", repeat="{ count = 3, about = [0, 0, 1] }")
    text += table("leg.body", name="carriage", mass=12.0, centre=hinge)
    text += table("leg.body", name="arm", link=(
        "{ beam = { radius = 0.035, inner_radius = 0.025 }, young = 2.1e11, "
        "poisson = 0.3, density = 7850.0 }"))  # fmt: skip
    text += table("leg.joint", name="rail", type="prismatic",
                  between=("base", "carriage"), at=hinge, axis=z, axis2=x,
                  actuated=True, limits=np.array([-0.2, 0.2]),
                  joint_stiffness="[2.0e6, 2.0e6, 2.0e6, 3.0e8, 3.0e8, 1.5e8]",
                  )  # fmt: skip
    text += table("leg.joint", name="hinge", type="revolute",
                  between=("carriage", "arm"), at=hinge, axis=y, axis2=x,
                  joint_stiffness="[5.0e5, 5.0e5, 0, 4.0e8, 4.0e8, 2.0e8]",
                  clearance="{ radial = 5e-6, axial = 1e-5, tilt = 1e-4 }")  # fmt: skip
    text += table("leg.joint", name="ball", type="spherical",
                  between=("arm", "platform"), at=ball, axis=z, axis2=x,
                  joint_stiffness="[0, 0, 0, 2.0e8, 2.0e8, 2.0e8]",
                  clearance="{ radial = 8e-6, axial = 8e-6 }")  # fmt: skip
    return text


def drawn_three_upu(snu=False):
    """The 3-UPU for translations (Tsai); of Seoul with radial outer axes."""
    lower, upper = np.array([0.24, 0.0, 0.0]), np.array([0.08, 0.0, 0.45])
    x, y, z = np.eye(3)
    along = (upper - lower) / np.linalg.norm(upper - lower)
    outer = x if snu else y
    inner = y if snu else np.cross(along, y)
    play = "[{}, { radial = 1e-5, axial = 1e-5, tilt = 2e-4 }]"
    text = head("upu", "platform", 0.45 * z)
    text += table("body", name="platform", mass=3.0, centre=0.45 * z)
    text += table("leg", name="leg", repeat="{ count = 3, about = [0, 0, 1] }")
    text += table("leg.body", name="tube")
    text += table("leg.body", name="rod", link=(
        "{ beam = { radius = 0.015 }, young = 2.1e11, poisson = 0.3, "
        "density = 7800.0 }"))  # fmt: skip
    text += table("leg.joint", name="lower", type="universal",
                  between=("base", "tube"), at=lower, axis=outer, axis2=inner,
                  clearance=play)  # fmt: skip
    text += table("leg.joint", name="slide", type="prismatic", between=("tube", "rod"),
                  at=lower, axis=along, axis2=y, actuated=True,
                  position=float(np.linalg.norm(upper - lower)),
                  drive_stiffness=2e7)  # fmt: skip
    text += table("leg.joint", name="upper", type="universal",
                  between=("rod", "platform"), at=upper, axis=inner, axis2=outer,
                  clearance=play)  # fmt: skip
    return text


def drawn_bennett():
    """Bennett's linkage; its platform is rigid with the second joint, at the third."""
    a, b = 0.2, 0.25711504387461576
    alpha, beta = 0.8726646259971648, 1.7453292519943295
    turns = (1.2217304763960306, 2.5470308920392566, 5.061454830783555,
             3.7361544151403296)  # fmt: skip
    T, places = np.eye(4), []
    for q, length, twist in zip(turns, (a, b, a, b), (alpha, beta) * 2, strict=True):
        places.append(T)
        T = T @ _turn("z", q) @ _shift(length) @ _turn("x", twist)
    # the platform keeps the axes of the second joint after its turn in the file of
    # frames; here they are the base's, and what is compared is read there
    tip = (places[1] @ _turn("z", turns[1]) @ _shift(b))[:3, 3]
    text = head("bennett", "second", tip)
    rod = ("{ beam = { radius = 0.012 }, young = 7e10, poisson = 0.33, "
           "density = 2700.0 }")  # fmt: skip
    text += table("body", name="first", link=rod)
    text += table("body", name="second", link=rod, mass=0.3, centre=tip)
    text = text.replace(
        'name = "second"\n', 'name = "second"\nfrom = "j3"\nto = "j2"\n'
    )
    text += table("body", name="third", link=rod)
    bodies = ("base", "first", "second", "third", "base")
    for k, place in enumerate(places):
        more = {"clearance": "{ radial = 2e-5, axial = 2e-5, tilt = 3e-4 }"}
        if k == 0:
            more = {"actuated": True, "drive_stiffness": 5e3}
        text += table("joint", name=f"j{k + 1}", type="revolute",
                      between=bodies[k : k + 2], at=place[:3, 3], axis=place[:3, 2],
                      axis2=place[:3, 0], position=turns[k], **more)  # fmt: skip
    return text


def _turn(axis, angle):
    return transform(np.zeros(3), rotation_matrix(angle * np.array(UNIT_VECTORS[axis])))


def _shift(x):
    return transform([x, 0.0, 0.0], np.eye(3))
