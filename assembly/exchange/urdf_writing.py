"""Export of a URDF and its loops file, with numbers in full precision."""

from xml.sax.saxutils import quoteattr

from numpy.typing import NDArray

from forcefit.assembly.exchange.loops_file import LoopsFile
from forcefit.assembly.exchange.mechanism import Body, Joint, Mechanism
from forcefit.assembly.exchange.orientation import to_roll_pitch_yaw

XML_MARK = "<!-- Written by forcefit. -->"


def urdf_text(mechanism: Mechanism) -> str:
    """Return the text of a URDF.

    Args:
        mechanism: mechanism in which ``after`` is the identity for all joints.

    Returns:
        The text, without loops, drives and home pose; see :func:`loops_of`.
    """
    lines = [XML_MARK, f"<robot name={quoteattr(mechanism.name)}>"]
    for body in mechanism.bodies.values():
        lines += _link(body)
    for joint in mechanism.joints:
        lines += _joint(joint)
    return "\n".join([*lines, "</robot>"]) + "\n"


def loops_of(mechanism: Mechanism) -> LoopsFile:
    """Return the content of the loops file, with loops, drives and home pose."""
    moving = [joint for joint in mechanism.joints if joint.kind != "fixed"]
    return LoopsFile(
        pairs=tuple((loop.first, loop.second) for loop in mechanism.loops),
        points=tuple(loop.point for loop in mechanism.loops),
        drives=tuple(joint.name for joint in moving if joint.actuated),
        home={joint.name: joint.position for joint in moving},
        platform=mechanism.platform,
    )


def numbers(values: NDArray | tuple[float, ...]) -> str:
    """Return numbers as text in full precision, separated by blanks."""
    return " ".join(repr(float(value)) for value in values)


def _link(body: Body) -> list[str]:
    """Return the lines of a ``<link>`` element."""
    name = quoteattr(body.name)
    if not body.mass and not body.inertia.any():
        return [f"  <link name={name}/>"]
    J = body.inertia
    entries = {"ixx": J[0, 0], "ixy": J[0, 1], "ixz": J[0, 2],
               "iyy": J[1, 1], "iyz": J[1, 2], "izz": J[2, 2]}  # fmt: skip
    inertia = " ".join(f'{key}="{float(v)!r}"' for key, v in entries.items())
    return [
        f"  <link name={name}>",
        "    <inertial>",
        f'      <origin xyz="{numbers(body.centre)}" rpy="0 0 0"/>',
        f'      <mass value="{float(body.mass)!r}"/>',
        f"      <inertia {inertia}/>",
        "    </inertial>",
        "  </link>",
    ]


def _joint(joint: Joint) -> list[str]:
    """Return the lines of a ``<joint>`` element."""
    kind = joint.kind
    if kind == "revolute" and joint.limits is None:
        kind = "continuous"
    T = joint.placement
    turn = to_roll_pitch_yaw(T[:3, :3])
    lines = [
        f'  <joint name={quoteattr(joint.name)} type="{kind}">',
        f'    <origin xyz="{numbers(T[:3, 3])}" rpy="{numbers(turn)}"/>',
        f"    <parent link={quoteattr(joint.parent)}/>",
        f"    <child link={quoteattr(joint.child)}/>",
    ]
    if joint.kind != "fixed":
        lines.append(f'    <axis xyz="{numbers(joint.axis)}"/>')
    if kind in {"revolute", "prismatic"}:  # these joint types require limits
        lower, upper = joint.limits or (-1e3, 1e3)
        lines.append(
            f'    <limit lower="{lower!r}" upper="{upper!r}" effort="1e6" '
            'velocity="1e3"/>'
        )
    return [*lines, "  </joint>"]
