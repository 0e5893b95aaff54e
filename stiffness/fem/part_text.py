"""Text format of materials in a part of a link, and of point masses."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.assignments import parse_assignments
from forcefit.inputs.errors import checked
from forcefit.inputs.number_arrays import comma_numbers
from forcefit.inputs.table import BadInput, Table, describe
from forcefit.stiffness.fem.mass_properties import PointMass
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.mesh.cut_face import CutFace
from forcefit.stiffness.surface.primitives import Plane

_PART = (
    '"z=0.2..0.4/young=2e11,poisson=0.3", "x=0..1,z=0..0.1/...,density=7800" or '
    '"solid=one+other/..."'
)
_MASS = '"1.5/0,0,0.452", a mass in kilograms and a position in metres'


def parse_part(option: str, text: str) -> Material:
    """Parse the text of a material in a box or in solids of a STEP file.

    Args:
        option: name of the option, for error messages.
        text: ``x=a..b,y=a..b,z=a..b/young=..,poisson=..,density=..`` or
            ``solid=one+other/young=..``. A box is unbounded along omitted axes, and the
            density is optional.

    Returns:
        The material.

    Raises:
        BadInput: the text has a different form.
    """
    region, slash, constants = text.rpartition("/")
    values = parse_assignments([constants], option) if slash else {}
    lacks = {"young", "poisson"} - set(values)
    if lacks or set(values) - {"young", "poisson", "density"}:
        raise BadInput(f"{option}: found {describe(text)}, expected {_PART}")
    density = checked(option, values.get("density", 0.0), "kg/m^3", least=0)
    constant = (values["young"], values["poisson"], density)
    kind, _, solid = (word.strip() for word in region.partition("="))
    try:
        if kind == "solid" and solid:
            return Material(*constant, solid=solid)
        low, high = _box(option, text, region)
        return Material(*constant, partial(_inside, low, high), _planes(low, high))
    except BadInput as error:
        if str(error).startswith(option):
            raise
        raise BadInput(f"{option}: {error}") from None


def _box(option: str, text: str, region: str) -> tuple[NDArray, NDArray]:
    """Return the lower and the upper corner of a box."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    for part in region.split(","):
        axis, _, span = (word.strip() for word in part.partition("="))
        ends = comma_numbers(span.replace("..", ","))
        if axis not in {"x", "y", "z"} or ends.shape != (2,) or ends[0] >= ends[1]:
            raise BadInput(f"{option}: found {describe(text)}, expected {_PART}")
        low["xyz".index(axis)], high["xyz".index(axis)] = ends
    return low, high


def read_parts(link: Table) -> tuple[str, ...]:
    """Read the key ``parts`` of a link in a TOML file.

    Args:
        link: TOML table of the link.

    Returns:
        The texts in the form of :func:`parse_part`, or an empty tuple.

    Raises:
        BadInput: the value is not a list of texts in this form.
    """
    given = link.get("parts", [])
    if not isinstance(given, list) or not all(isinstance(t, str) for t in given):
        expected = 'a list such as ["solid=end/young=2e11,poisson=0.3"]'
        raise link.bad("parts", f"found {describe(given)}, expected {expected}")
    for text in given:
        parse_part(f"{link.file}: {link.place}.parts", text)
    return tuple(given)


def scaled_part(text: str, factor: float) -> str:
    """Multiply Young's modulus in the text of a material by a factor.

    Args:
        text: text in the form of :func:`parse_part`.
        factor: [1] factor on Young's modulus.

    Returns:
        The text with the new modulus.
    """
    region, _, constants = text.rpartition("/")
    values = parse_assignments([constants], "part")
    values["young"] *= factor
    return f"{region}/" + ",".join(f"{k}={v!r}" for k, v in values.items())


def parse_mass(option: str, text: str) -> PointMass:
    """Parse the text of a point mass, such as ``1.5/0,0,0.452``.

    Args:
        option: name of the option, for error messages.
        text: mass [kg] and position [m].

    Returns:
        The point mass.

    Raises:
        BadInput: the text has a different form.
    """
    mass, _, place = text.partition("/")
    weight, point = comma_numbers(mass), comma_numbers(place)
    if weight.shape != (1,) or point.shape != (3,):
        raise BadInput(f"{option}: found {describe(text)}, expected {_MASS}")
    return PointMass(checked(option, float(weight[0]), "kg", above=0), point)


def _planes(low: NDArray, high: NDArray) -> tuple[CutFace, ...]:
    """Return the finite faces of a box."""
    axes = np.eye(3)
    return tuple(
        CutFace(Plane(end[k] * axes[k], axes[k]))
        for end in (low, high)
        for k in range(3)
        if np.isfinite(end[k])
    )


def _inside(low: NDArray, high: NDArray, points: NDArray) -> NDArray:
    """Return whether each point is in a box, (n,)."""
    return np.asarray(((points >= low) & (points <= high)).all(axis=-1))
