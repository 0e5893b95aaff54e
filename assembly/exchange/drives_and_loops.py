"""Addition of loops, drives, joint types and home pose from a loops file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from forcefit.assembly.exchange.coupling import Coupling
from forcefit.assembly.exchange.loops_file import LoopsFile, unknown_name
from forcefit.assembly.exchange.mechanism import (
    Joint,
    Loop,
    Mechanism,
    ball,
    chain,
)
from forcefit.assembly.exchange.xml_file import counted
from forcefit.inputs.errors import BadInput, quoted


def with_loops(
    mechanism: Mechanism, loops: LoopsFile | None, parts: Mapping[str, Sequence[str]],
    driven: set[str],
) -> Mechanism:  # fmt: skip
    """Add the loops, drives, platform and home pose of a loops file to a mechanism.

    Args:
        mechanism: mechanism of the robot's file.
        loops: the loops file; None if there is none.
        parts: names of the elementary joints, by the name of the joint in the file.
        driven: joints that the robot's file declares as driven.

    Returns:
        The mechanism. Its drives are the drives that the loops file lists. If the loops
        file does not list drives, they are the joints in ``driven``. If this set is
        empty and there are no loops, all joints are driven.

    Raises:
        BadInput: a name is not a joint or link of the robot.
    """
    loops = loops or LoopsFile()
    for name in (*loops.turns, *loops.home, *(loops.drives or ())):
        key = "joint_name" if name in loops.turns else "name_mot"
        key = "home" if name in loops.home else key
        if name not in parts:
            raise BadInput(unknown_name(loops, key, name, list(parts)))
    mechanism, parts = _retyped(mechanism, loops.turns, parts)
    ends = {name: name for name in mechanism.bodies}
    children = {joint.name: joint.child for joint in mechanism.joints}
    # the child body of a compound joint is the child body of its last elementary joint
    ends |= {name: children[several[-1]] for name, several in parts.items()}
    # a fixed joint and its link may have the same name, because they are one frame
    count, closed = len(mechanism.loops), list(mechanism.loops)
    for i, (pair, point) in enumerate(zip(loops.pairs, loops.points, strict=True), 1):
        for name in pair:
            if name not in ends:
                key = f"closed_loop[{i}]"
                raise BadInput(unknown_name(loops, key, name, list(ends)))
        first, second = (ends[name] for name in pair)
        if first == second:
            raise BadInput(
                f"{loops.file}: closed_loop[{i}]: found {quoted(pair[0])} and "
                f"{quoted(pair[1])}, both on the link {quoted(first)}; expected "
                "two different links"
            )
        closed.append(Loop(f"loop{count + i}", first, second, point=point))
    platform = loops.platform
    if platform is not None and platform not in ends:
        raise BadInput(unknown_name(loops, "platform", platform, list(ends)))
    if loops.drives is not None:
        driven = set(loops.drives)
    elif not driven and not closed:
        driven = set(parts)
    drives = {part for name in driven & set(parts) for part in parts[name]}
    drives |= {coupling.follower for coupling in mechanism.couplings}
    joints = tuple(
        replace(
            joint,
            actuated=joint.kind != "fixed" and (joint.actuated or joint.name in drives),
            position=loops.home.get(joint.name, joint.position),
        )
        for joint in mechanism.joints
    )
    joints = _followed(joints, mechanism.couplings, loops)
    left_out = list(mechanism.left_out)
    left_out += _couplings_said(joints, mechanism.couplings)
    left_out += counted("keys of the loops file", list(loops.passed_over))
    if not any(joint.actuated for joint in joints):
        left_out.append("no drive is named (name_mot): every joint is passive")
    return replace(
        mechanism,
        joints=joints,
        loops=tuple(closed),
        platform=mechanism.platform if platform is None else ends[platform],
        left_out=tuple(left_out),
    )


def _followed(
    joints: tuple[Joint, ...], couplings: Sequence[Coupling], loops: LoopsFile
) -> tuple[Joint, ...]:
    """Set the home coordinates of coupled joints according to their couplings."""
    at = {joint.name: joint.position for joint in joints}
    for coupling in couplings:
        name = coupling.follower
        value = coupling.at(at.get(coupling.leader or "", 0.0))[0]
        given = loops.home.get(name, value)
        if abs(given - value) > 1e-9 * max(1.0, abs(value)):
            raise BadInput(
                f"{loops.file}: home.{name}: found {given:g}, but the joint "
                f"follows another joint ({coupling.text()}); expected "
                f"{value:.12g}, or remove this entry"
            )
        at[name] = value
    return tuple(replace(joint, position=at[joint.name]) for joint in joints)


def _couplings_said(
    joints: tuple[Joint, ...], couplings: Sequence[Coupling]
) -> Iterator[str]:
    """Yield a remark on each coupled joint, which becomes an independent drive."""
    driven = {joint.name for joint in joints if joint.actuated}
    for coupling in couplings:
        line = (
            f"mimic: {coupling.text()} becomes an independent drive; command it "
            "according to this equation"
        )
        if coupling.leader is not None and coupling.leader not in driven:
            line += (
                f" ({coupling.leader} is passive, and no force is transmitted between "
                "the two joints)"
            )
        yield line


def _retyped(
    mechanism: Mechanism, turns: Mapping[str, str], parts: Mapping[str, Sequence[str]]
) -> tuple[Mechanism, dict[str, list[str]]]:
    """Replace joints by the joint types that a loops file declares."""
    bodies, joints = dict(mechanism.bodies), list[Joint]()
    now = {name: list(several) for name, several in parts.items()}
    for joint in mechanism.joints:
        axes = turns.get(joint.name)
        if axes is None:
            joints.append(joint)
        elif not axes:
            joints.append(replace(joint, kind="fixed"))
        else:
            several, between = chain(
                joint.name, joint.parent, joint.child, joint.placement, joint.after,
                ball(axes),
            )  # fmt: skip
            joints += several
            bodies |= {body.name: body for body in between}
            now[joint.name] = [one.name for one in several]
    return replace(mechanism, bodies=bodies, joints=tuple(joints)), now
