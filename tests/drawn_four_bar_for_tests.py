"""Four-bar linkage with toleranced lengths, and its error coefficients.

The lengths are 0.1 m (crank, driven, at 60 deg), 0.25 m (coupler), 0.2 m (rocker) and
0.3 m (ground).  The platform is a point at a distance of 50 mm from the middle of the
coupler.  Projecting the loop equation on the rocker direction e4 gives the coupler
rotation -(e2.e4 da + e3.e4 db - dc - ex.e4 dd)/(b sin(theta4 - theta3)).
"""

import math

A_LENGTH, B_LENGTH, C_LENGTH, D_LENGTH = 0.1, 0.25, 0.2, 0.3
COEFFICIENTS = {"crank": 0.793, "coupler": 0.325, "rocker": 1.0, "base": 0.132}
LEVER = B_LENGTH * 0.9457  # [m] b sin(theta4 - theta3)
_TOLERANCE = """
[[{table}]]
feature = "{feature}"
datums = ["{datum}"]
length = "{mm} +- 0.02 mm"
"""
_JOINT = """
[[joint]]
name = "{name}"
type = "revolute"
between = {between}
at = [{x!r}, {y!r}, 0]
axis = [0, 0, 1]
{more}
"""


def four_bar_file(clearance=""):
    """Return the text of the robot file.

    Args:
        clearance: clearance of each pin, for example ``radial = 10e-6``.
    """
    B = (A_LENGTH / 2, A_LENGTH * math.sqrt(3) / 2)
    dx, dy = D_LENGTH - B[0], -B[1]
    size = math.hypot(dx, dy)
    x = (B_LENGTH**2 - C_LENGTH**2 + size**2) / (2 * size)
    y = math.sqrt(B_LENGTH**2 - x**2)
    C = (B[0] + (dx * x - dy * y) / size, B[1] + (dy * x + dx * y) / size)
    angle = math.atan2(C[1] - B[1], C[0] - B[0])
    point = [(p + q) / 2 for p, q in zip(B, C, strict=True)]
    point = [point[0] - 0.05 * math.sin(angle), point[1] + 0.05 * math.cos(angle)]
    text = 'format = 2\nname = "four_bar"\nplatform = "coupler"\n'
    text += f"platform_at = [{point[0]!r}, {point[1]!r}, 0]\n"
    text += _TOLERANCE.format(table="tolerance", feature="D", datum="A", mm=300)
    for body, feature, datum, mm in [
        ("crank", "B", "A", 100), ("coupler", "C", "B", 250), ("rocker", "C", "D", 200),
    ]:  # fmt: skip
        text += f'[[body]]\nname = "{body}"\n'
        text += _TOLERANCE.format(
            table="body.tolerance", feature=feature, datum=datum, mm=mm
        )
    more = f"clearance = {{ {clearance} }}\n" if clearance else ""
    joints = [
        ("A", '["base", "crank"]', (0.0, 0.0), "actuated = true\n"),
        ("B", '["crank", "coupler"]', B, ""), ("C", '["coupler", "rocker"]', C, ""),
        ("D", '["base", "rocker"]', (D_LENGTH, 0.0), ""),
    ]  # fmt: skip
    for name, between, (x, y), own in joints:
        text += _JOINT.format(name=name, between=between, x=x, y=y, more=own + more)
    return text
