"""Import of SDF, in which joints may close loops.

Sources:
    sdformat.org, specification 1.12; see also the modules ``sdf_*.py``.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from forcefit.assembly.exchange.coupling import leaders_first
from forcefit.assembly.exchange.drives_and_loops import with_loops
from forcefit.assembly.exchange.loops_file import LoopsFile
from forcefit.assembly.exchange.mechanism import (
    WORLD,
    Body,
    Joint,
    Loop,
    Mechanism,
    parents_first,
)
from forcefit.assembly.exchange.sdf_frames import (
    FRAMES,
    MODEL,
    Frames,
    frames_of,
)
from forcefit.assembly.exchange.sdf_joint import (
    joint_couplings,
    joint_ends,
    joint_parts,
)
from forcefit.assembly.exchange.sdf_mass import link_body
from forcefit.assembly.exchange.ties import may_tie, refuse_ties
from forcefit.assembly.exchange.xml_file import Node, counted, read_xml
from forcefit.inputs.errors import BadInput

_HELD = {"joint": ("pose", "parent", "child", "axis", "axis2", "thread_pitch",
                   "screw_thread_pitch"),
         "link": ("pose", "inertial")}  # fmt: skip
_RANGE = ("lower", "upper")
_HELD_OF_AXIS = ("xyz", "use_parent_model_frame", "mimic")


def read_sdf(path: Path | str, loops: LoopsFile | None = None) -> Mechanism:
    """Read an SDF file with one model, which may contain nested models.

    Args:
        path: path of the file.
        loops: loops file with drives and additional loops, or None.

    Returns:
        Mechanism.  Its root is the world or the canonical link of the model.  Joints
        that close a loop become loop closures.

    Raises:
        BadInput: the file does not comply with the format, or a joint type is unknown.
    """
    root = read_xml(path, "sdf")
    frames = frames_of(root)
    model = frames.model
    made = {name: link_body(frames, name, named) for name, named in frames.of("link")}
    if not made:
        raise BadInput(f"{path}: link: missing; expected at least one link")
    bodies = {name: body for name, (body, _) in made.items()}
    ends = {name: joint_ends(frames, named) for name, named in frames.of("joint")}
    first = frames.link(MODEL)
    tied = any(WORLD in pair for pair in ends.values())
    stands_off = not np.array_equal(frames.pose(first), np.eye(4))
    if tied or stands_off:
        bodies = {WORLD: Body(WORLD), **bodies}
    held = []
    if stands_off and not tied:
        held = [Joint(f"{first}.joint", "fixed", WORLD, first, frames.pose(first))]
    tree, parts, closed = _tree(frames, ends, bodies, first, held)
    base, order = parents_first(tree, bodies, str(path))
    couplings = [
        coupling
        for name, named in frames.of("joint")
        for coupling in joint_couplings(frames, name, named, parts)
    ]
    mechanism = Mechanism(
        name=model.text("name", Path(path).stem), root=base, bodies=bodies,
        joints=order, loops=tuple(closed), left_out=tuple(_left_out(frames, root)),
        taken=tuple(_taken({name: words for name, (_, words) in made.items()})),
        couplings=leaders_first(couplings, str(path)),
    )  # fmt: skip
    return with_loops(mechanism, loops, parts, set())


def _tree(
    frames: Frames, ends: dict[str, tuple[str, str]], bodies: dict[str, Body],
    first: str, held: list[Joint],
) -> tuple[list[Joint], dict[str, list[str]], list[Loop]]:  # fmt: skip
    """Return the joints of a tree, names of elementary joints, and loop closures."""
    reached = {first} if held or WORLD not in bodies else {WORLD}
    tree, loops, waiting = held, list[Loop](), list(ends)
    parts: dict[str, list[str]] = {}
    while waiting:
        # the first joint in the file that is connected to the tree
        name = next((n for n in waiting if reached & set(ends[n])), waiting[0])
        waiting.remove(name)
        parent, child = ends[name]
        tip, backwards = "", child in reached
        if backwards and parent in reached:  # the joint closes a loop
            tip, backwards = f"{name}.tip", False
            bodies[tip] = Body(tip)
            loops.append(Loop(name, tip, child))
        carried = tip or (parent if backwards else child)
        several, between = joint_parts(
            frames, name, frames.named[name], ends[name], carried, backwards
        )
        reached |= {parent, child}
        bodies |= {body.name: body for body in between}
        parts[name] = [joint.name for joint in several]
        tree += several
    return tree, parts, loops


def _of_axis(joint: Node, tag: str, part: Node) -> str:
    """Describe a property of an axis that is not converted, or return an empty text."""
    spring = part.child("spring_stiffness")
    # both axes are read for universal and revolute2 joints, and only the first axis for
    # other joints
    crossed = joint.optional("type") in {"universal", "revolute2"}
    single = joint.optional("type") not in {"ball", "screw"}
    taken = crossed or (tag == "axis" and single)
    if not taken and spring is not None and spring.number("", "-") > 0:
        return f"joint axis {part.tag}, not converted, though it may carry load"
    if part.tag == "limit" and taken:
        rest = [one.tag for one in part.children() if one.tag not in _RANGE]
        return f"joint axis limit {', '.join(rest)}" if rest else ""
    screw = joint.optional("type") == "screw"
    if part.tag == "limit" and screw:
        return "joint axis limit of a screw, whose unit the format does not define"
    springs_alone = all(one.tag.startswith("spring_") for one in part.children())
    held = part.tag in _HELD_OF_AXIS or (part.tag == "dynamics" and springs_alone)
    return "" if held else f"joint axis {part.tag}"


def _taken(words: dict[str, str]) -> Iterator[str]:
    """Yield each assumption on masses together with the names of the links."""
    by_words: dict[str, list[str]] = {}
    for name, line in words.items():
        if line:
            by_words.setdefault(f"mass of links, {line}", []).append(name)
    for what, names in by_words.items():
        yield from counted(what, names)


def _left_out(frames: Frames, root: Node) -> Iterator[str]:
    """Yield descriptions of SDF elements that are not converted."""
    extra: dict[str, list[str]] = {}

    def add(what: str, name: str) -> None:
        extra.setdefault(what, []).append(name)

    links = {name for name, _ in frames.of("link")} - {WORLD}
    tied = {name for name, _ in frames.of("frame")}
    joints = {name for name, _ in frames.of("joint")}
    for node in (
        inner for world in root.children("world") for inner in world.children()
    ):
        if (
            node.tag not in {"frame", "joint"}
            and node.element is not frames.model.element
        ):
            add(f"{node.tag} of the world", node.optional("name"))
    for _, model in frames.of("model"):
        for node in model.node.children():
            movable = node.tag == "static" and node.content.lower() in {
                "",
                "0",
                "false",
            }
            if not movable and node.tag not in (*FRAMES, "pose", "model", "include"):
                owners = {k: frames.link(k) for k in frames.named if k in tied}
                refuse_ties(node, {**owners, **{link: link for link in links}})
                add(f"element {node.tag}{may_tie(node, joints)}", node.optional("name"))
    for tag, held in _HELD.items():
        for name, named in frames.of(tag):
            for inner in named.node.children():
                if inner.tag not in held:
                    add(f"{tag} {inner.tag}", name)
                elif inner.tag in {"axis", "axis2"}:
                    for part in inner.children():
                        what = _of_axis(named.node, inner.tag, part)
                        if what:
                            add(what, name)
    for what, names in extra.items():
        yield from counted(what, names)
