"""Elements that nobody here knows, and whether they may tie bodies to one another."""

from collections.abc import Container

from assembly.exchange.xml_file import Node
from forcefit.inputs.errors import quoted

# of a name: what refers to bodies and neither holds nor moves them; a plugin is a
# program, which the answer names
_HARMLESS = ("collision", "collide", "material", "transmission", "control", "sensor",
             "plugin", "gripper", "visual", "group", "state")  # fmt: skip


def refuse_ties(node: Node, bodies: Container[str]) -> None:
    """Refuse an unknown element that names two bodies, which it may tie.

    Args:
        node: an element that is not converted.
        bodies: names of the robot's bodies.

    Raises:
        BadInput: it names two of them, and is of no harmless kind.
    """
    if any(part in node.tag.lower() for part in _HARMLESS):
        return
    named = node.names_in(bodies)
    if len(named) > 1:
        raise node.bad(
            "", f"found it between {quoted(named[0])} and {quoted(named[1])}: it may "
            "tie them, and is not converted; expected joints, or a file without it"
        )  # fmt: skip
