"""Detection of unknown XML elements that may connect bodies."""

from collections.abc import Container, Mapping

from forcefit.assembly.exchange.xml_file import Node
from forcefit.inputs.errors import quoted

# words in names of elements that refer to bodies without constraining or moving them;
# plugins, which are programs, are reported by name
_HARMLESS = ("collision", "collide", "material", "transmission", "control", "sensor",
             "plugin", "gripper", "visual", "group", "state")  # fmt: skip


def refuse_ties(node: Node, owners: Mapping[str, str]) -> None:
    """Reject an unknown element that refers to two bodies and may connect them.

    Args:
        node: element that is not converted.
        owners: bodies by their own names and by the names of frames on them.

    Raises:
        BadInput: the element refers to two bodies, and its kind may connect them.
    """
    if _is_harmless(node):
        return
    named = node.names_in(owners)
    if len({owners[name] for name in named}) > 1:
        raise node.bad(
            "", f"found an element between {quoted(named[0])} and "
            f"{quoted(named[1])} that may connect them and is not converted; "
            "expected joints: declare a joint or a loop, or remove the element"
        )  # fmt: skip


def _is_harmless(node: Node) -> bool:
    """Return whether an element refers to bodies without constraining them."""
    return any(part in node.tag.lower() for part in _HARMLESS)


def may_tie(node: Node, names: Container[str]) -> str:
    """Return a warning for an omitted element that may connect bodies, or "".

    Args:
        node: element that is not converted.
        names: names of joints and bodies.

    Returns:
        Words to be appended to the element's name.
    """
    unknown = node.tag == "plugin" or not _is_harmless(node)
    if unknown and len(node.names_in(names)) > 1:
        return ", not converted, though it may connect or move the bodies that it names"
    if node.tag == "springStiffness":  # Gazebo's spring at a URDF joint
        return ", not converted, though it may carry load"
    return ""
