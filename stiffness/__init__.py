"""How stiff is a link?

The public names; what needs a mesh is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from stiffness.beam import (
    Section,
    beam_compliance,
    rectangular_section,
    round_section,
)
from stiffness.interface import Interface, parse_interface
from stiffness.link import LinkStiffness, turn_link
from stiffness.reading import BadInput

if TYPE_CHECKING:
    from stiffness.fea import mesh_link

__all__ = [
    "BadInput",
    "Interface",
    "LinkStiffness",
    "Section",
    "beam_compliance",
    "mesh_link",
    "parse_interface",
    "rectangular_section",
    "round_section",
    "turn_link",
]

_LAZY = {"mesh_link": "stiffness.fea"}


def __getattr__(name: str) -> object:
    """Import a heavy name when it is first asked for."""
    if name not in _LAZY:
        raise AttributeError(f"module 'stiffness' has no attribute {name!r}")
    return getattr(import_module(_LAZY[name]), name)
