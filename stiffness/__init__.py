"""How stiff is a link?

The public names; each is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stiffness.beam import (
        Section,
        beam_compliance,
        rectangular_section,
        round_section,
    )
    from stiffness.fea import mesh_link
    from stiffness.interface import Interface, parse_interface
    from stiffness.link import LinkStiffness, turn_link
    from stiffness.message import BadInput

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

_OWNERS = {
    "BadInput": "stiffness.message",
    "Interface": "stiffness.interface",
    "LinkStiffness": "stiffness.link",
    "Section": "stiffness.beam",
    "beam_compliance": "stiffness.beam",
    "mesh_link": "stiffness.fea",
    "parse_interface": "stiffness.interface",
    "rectangular_section": "stiffness.beam",
    "round_section": "stiffness.beam",
    "turn_link": "stiffness.link",
}


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for."""
    if name not in _OWNERS:
        raise AttributeError(f"module 'stiffness' has no attribute {name!r}")
    return getattr(import_module(_OWNERS[name]), name)
