"""Detection of unknown XML elements that may connect bodies."""

from collections.abc import Container, Mapping

from forcefit.assembly.exchange.xml_file import Node
from forcefit.inputs.errors import quoted

# words in the tags of elements that do not constrain bodies
_HARMLESS = ("collision", "collide", "material", "transmission", "control", "sensor",
             "plugin", "gripper", "visual", "group", "state")  # fmt: skip


def refuse_ties(node: Node, owners: Mapping[str, str]) -> None:
    """Reject an unknown element that refers to two bodies and may connect them.

    Args:
        node: element that is not converted.
        owners: name of the body to which a name of a body or frame belongs.

    Raises:
        BadInput: the element refers to two bodies and may connect them.
    """
    if _is_harmless(node):
        return
    named = node.names_in(owners)
    if len({owners[name] for name in named}) > 1:
        raise node.bad(
            "", f"found an element that may connect {quoted(named[0])} and "
            f"{quoted(named[1])} and cannot be converted, expected a joint or a loop; "
            "declare a joint or a loop, or remove the element"
        )  # fmt: skip


def _is_harmless(node: Node) -> bool:
    """Return whether an element, according to its tag, does not constrain bodies."""
    return any(part in node.tag.lower() for part in _HARMLESS)


def may_tie(node: Node, names: Container[str]) -> str:
    """Return a warning if an omitted element may connect bodies, or an empty text.

    Args:
        node: element that is not converted.
        names: names of joints and bodies.

    Returns:
        Text that is appended to the name of the element.
    """
    unknown = node.tag == "plugin" or not _is_harmless(node)
    if unknown and len(node.names_in(names)) > 1:
        return ", not converted, though it may connect or move the bodies that it names"
    if node.tag == "springStiffness":  # spring of a URDF joint in Gazebo
        return ", not converted, though it may carry load"
    return ""
