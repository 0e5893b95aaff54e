"""Export of MJCF, with loops as weld constraints and the home pose as a keyframe."""

from xml.sax.saxutils import quoteattr

import numpy as np

from forcefit.assembly.exchange.mechanism import Joint, Mechanism
from forcefit.assembly.exchange.orientation import to_quaternion
from forcefit.assembly.exchange.urdf_writing import XML_MARK, numbers

_SMALLEST_INERTIA = 1e-9  # [kg m^2] smallest moment of inertia in the output file
_KINDS = {"revolute": "hinge", "prismatic": "slide"}


def mjcf_text(mechanism: Mechanism) -> str:
    """Return the text of an MJCF file.

    Args:
        mechanism: mechanism in which ``after`` is the identity for all joints.

    Returns:
        The text.  Because MuJoCo requires a mass for each moving body, the compiler
        element sets the smallest possible mass for massless bodies.
    """
    moving = [joint for joint in mechanism.joints if joint.kind != "fixed"]
    lines = [
        XML_MARK,
        f"<mujoco model={quoteattr(mechanism.name)}>",
        '  <compiler angle="radian" boundmass="1e-6" boundinertia="1e-9"/>',
    ]
    if mechanism.platform is not None:
        name = quoteattr(mechanism.platform)
        lines.append(f'  <custom><text name="platform" data={name}/></custom>')
    lines += ["  <worldbody>", *_bodies(mechanism), "  </worldbody>"]
    if mechanism.loops:
        lines.append("  <equality>")
        for loop in mechanism.loops:
            ends = f"body1={quoteattr(loop.first)} body2={quoteattr(loop.second)}"
            name = quoteattr(loop.name)
            pose = 'relpose="0 0 0 1 0 0 0"'
            lines.append(f"    <weld name={name} {ends} {pose}/>")
        lines.append("  </equality>")
    drives = [joint for joint in moving if joint.actuated]
    if drives:
        lines.append("  <actuator>")
        for joint in drives:
            name = quoteattr(joint.name)
            lines.append(f"    <position name={name} joint={name}/>")
        lines.append("  </actuator>")
    if moving:
        qpos = numbers(tuple(j.position for j in depth_first(mechanism, moving=True)))
        lines.append(f'  <keyframe><key name="home" qpos="{qpos}"/></keyframe>')
    return "\n".join([*lines, "</mujoco>"]) + "\n"


def depth_first(mechanism: Mechanism, moving: bool = False) -> list[Joint]:
    """Return the joints, or only the moving joints, in depth-first order."""
    below: dict[str, list[Joint]] = {}
    for joint in mechanism.joints:
        below.setdefault(joint.parent, []).append(joint)
    order, waiting = [], list(reversed(below.get(mechanism.root, [])))
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += reversed(below.get(joint.child, []))
    return [joint for joint in order if not moving or joint.kind != "fixed"]


def _bodies(mechanism: Mechanism) -> list[str]:
    """Return the lines of the nested bodies.

    The function is not recursive, because chains may exceed the recursion limit.
    """
    lines: list[str] = []
    open_bodies = [mechanism.root]

    def close_until(parent: str) -> None:
        while open_bodies[-1] != parent:
            open_bodies.pop()
            lines.append(f"{'  ' * (len(open_bodies) + 1)}</body>")

    for joint in depth_first(mechanism):
        close_until(joint.parent)
        pad = "  " * (len(open_bodies) + 1)
        T, body = joint.placement, mechanism.bodies[joint.child]
        pose = f'pos="{numbers(T[:3, 3])}" quat="{numbers(to_quaternion(T[:3, :3]))}"'
        lines.append(f"{pad}<body name={quoteattr(body.name)} {pose}>")
        open_bodies.append(body.name)
        if joint.kind != "fixed":
            kind, axis = _KINDS[joint.kind], numbers(joint.axis)
            name = quoteattr(joint.name)
            limits = ""
            if joint.limits is not None:
                limits = f' limited="true" range="{numbers(joint.limits)}"'
            lines.append(
                f'{pad}  <joint name={name} type="{kind}" axis="{axis}"{limits}/>'
            )
        if body.mass or body.inertia.any():
            J = body.inertia
            # MJCF does not permit collinear masses, whose moment of inertia about their
            # line is zero
            if np.linalg.eigvalsh(J)[0] < _SMALLEST_INERTIA:
                J = J + _SMALLEST_INERTIA * np.eye(3)
            full = numbers(np.array([J[0, 0], J[1, 1], J[2, 2],
                                     J[0, 1], J[0, 2], J[1, 2]]))  # fmt: skip
            lines.append(
                f'{pad}  <inertial pos="{numbers(body.centre)}" '
                f'mass="{float(body.mass)!r}" fullinertia="{full}"/>'
            )
    close_until(mechanism.root)
    return lines
