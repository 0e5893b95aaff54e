"""Reading of links in robot files with ``format = 2``, including curved beams."""

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.files.link_file import read_link
from forcefit.assembly.files.link_models import model_link
from forcefit.assembly.files.written_units import without_units
from forcefit.assembly.model.largest import LARGEST
from forcefit.assembly.model.robot import Link, MatrixLink
from forcefit.inputs.table import BadInput, Table, describe, nearest, quoted
from forcefit.stiffness.beam.curve import curve_compliance, curve_mass
from forcefit.stiffness.beam.curve_file import read_pieces

_LENGTHS = ("radius", "inner_radius", "width", "height", "length", "wall", "web",
            "flange")  # fmt: skip
_CURVE = ("curve", "young", "poisson", "density", "theory")
_KINDS = ("beam", "curve", "stiffness", "mesh", "library", "model")
# [-] largest distance from the end of a curve to the joint, relative to the distance
# between both joints
_GAP = 1e-6


@dataclass(frozen=True, eq=False)
class Curve:
    """Link whose stiffness depends on the positions of its end joints.

    Attributes:
        table: table of a curved beam or of a link model from another distribution.
    """

    table: Table


def read_drawn_link(body: Table) -> Link | Curve | None:
    """Read the link of a body.

    Args:
        body: table of the body, in which texts with units are replaced by numbers.

    Returns:
        Link with directions in base axes in the home pose, ``Curve``, or None for a
        rigid body.

    Raises:
        BadInput: the table is invalid.
    """
    link = body.content.get("link")
    if isinstance(link, dict) and not set(_KINDS) & set(link):
        _refuse_no_kind(body.table("link"))
    if isinstance(link, dict) and set(link) == {"model"}:
        return Curve(body.table("link"))
    if not isinstance(link, dict) or "curve" not in link:
        if isinstance(link, dict) and isinstance(link.get("beam"), dict):
            _plain_lengths(link["beam"], body, "link.beam")
        return read_link(body, np.zeros(3))
    table = body.table("link")
    for key in table.content:
        if key not in _CURVE:
            names = " | ".join(f'"{name}"' for name in _CURVE[1:])
            raise table.bad(key, f'found together with "curve", expected only {names}')
    return Curve(table)


def _refuse_no_kind(link: Table) -> NoReturn:
    """Raise an error for an unknown type of link."""
    unknown = [key for key in link.content if key not in (*_CURVE, "pieces", "up")]
    if unknown:
        hint = nearest(unknown[0], _KINDS)
        raise link.bad("", f"unknown key {quoted(unknown[0])}{hint}")
    names = " | ".join(map(quoted, _KINDS))
    raise link.bad("", f"found no type of link, expected exactly one of {names}")


def _plain_lengths(content: dict[str, Any], body: Table, place: str) -> None:
    """Replace texts with units in a cross section by numbers."""
    inner = Table(content, body.file, f"{body.place}.{place}")
    for key in _LENGTHS:
        without_units(inner, key, "length")


def curve_link(
    curve: Curve, start: NDArray, tip: NDArray
) -> tuple[MatrixLink, float, NDArray, NDArray]:
    """Compute the stiffness and mass of a curved beam or of a link model.

    Args:
        curve: curved beam or link model from the file.
        start: position of the joint at the start of the link, (3,) [m].
        tip: pose of the joint at the end of the link, (4, 4).

    Returns:
        Stiffness in the frame of the tip, mass [kg], centre of mass, (3,) [m], and
        inertia matrix about the centre of mass, (3, 3) [kg m^2].  Without a density,
        the mass is 0.

    Raises:
        BadInput: a segment or a material constant is invalid, or the curve does not end
            at the joint.
    """
    table = curve.table
    if table.has("model"):
        span = tip[:3, :3].T @ (tip[:3, 3] - start)
        return model_link(table, span), 0.0, np.zeros(3), np.zeros((3, 3))
    young = table.number("young", "Pa", above=0.0, largest=LARGEST)
    poisson = table.number("poisson", "-", above=-1.0, below=0.5)
    theory = table.choice("theory", ("timoshenko", "euler"), "timoshenko")
    tables = table.tables("curve")
    if not tables:
        raise table.bad("curve", f"found {describe([])}, expected at least one segment")
    for part in tables:
        without_units(part, "end", "length")
        without_units(part, "center", "length")
        without_units(part, "turn", "angle")
        for key in ("section", "tip_section"):
            if isinstance(part.content.get(key), dict):
                _plain_lengths(part.content[key], part, key)
    pieces = read_pieces(tables, start, poisson)
    gap = float(np.linalg.norm(pieces[-1].place(1.0) - tip[:3, 3]))
    if gap > _GAP * float(np.linalg.norm(tip[:3, 3] - start)):
        fault = f"found the end of the curve {gap:.3g} m away from the joint"
        raise table.bad("curve", f"{fault}, expected 0 m")
    try:
        C = curve_compliance(pieces, young, poisson, theory=theory)
    except BadInput as error:
        raise table.bad("curve", str(error)) from None
    turn = np.kron(np.eye(2), tip[:3, :3])
    K = np.linalg.inv(turn.T @ C @ turn)
    mass, centre, J = 0.0, np.zeros(3), np.zeros((3, 3))
    if table.has("density"):
        density = table.number("density", "kg/m^3", above=0.0, largest=LARGEST)
        mass, centre, J = curve_mass(pieces, density)
    return MatrixLink((K + K.T) / 2), mass, centre, J
