"""Cross-sections of beams and their constants.

========  ======================================================  =====
symbol    meaning                                                 unit
========  ======================================================  =====
y z       section axes, z up                                      -
I_y I_z   second moments of area; I_y bends about y               m^4
J         Saint-Venant's torsion constant                         m^4
shear_*   shear area for a force along y or z, divided by area    1
========  ======================================================  =====
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from forcefit.inputs.errors import LARGEST, BadInput, nearest


@dataclass(frozen=True)
class Section:
    """Section constants of a straight beam.

    Attributes:
        area: [m^2] area.
        I_y: [m^4] second moment of area for bending about y (deflection along z).
        I_z: [m^4] second moment of area for bending about z (deflection along y).
        J: [m^4] torsion constant.
        shear_y: [-] shear area for a force along y, divided by the area.
        shear_z: [-] shear area for a force along z, divided by the area.
    """

    area: float
    I_y: float
    I_z: float
    J: float
    shear_y: float
    shear_z: float

    def __post_init__(self) -> None:
        for item in fields(self):
            check_positive("section", item.name, getattr(self, item.name))

    @property
    def size(self) -> float:
        """Twice the larger radius of gyration [m]."""
        return 2 * math.sqrt(max(self.I_y, self.I_z) / self.area)


_SECTIONS = (
    {"radius"},
    {"radius", "inner_radius"},
    {"width", "height"},
    {"width", "height", "wall"},
    {"width", "height", "web", "flange"},
    {item.name for item in fields(Section)},
)


def round_section(radius: float, nu: float, inner_radius: float = 0.0) -> Section:
    """Return the section of a round bar or tube.

    Args:
        radius: [m] outer radius, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5), which determines the shear factor.
        inner_radius: [m] inner radius, < ``radius``; 0 for a solid bar.

    Returns:
        The section.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of range.

    Sources:
        Cowper (1966), "The shear coefficient in Timoshenko's beam theory", for a circle
        and for a thick tube.
    """
    check_positive("round_section", "radius", radius)
    if not 0.0 <= inner_radius < radius:
        raise BadInput(
            f"round_section: inner_radius = {inner_radius:g} must lie between 0 "
            f"and radius = {radius:g}"
        )
    check_poisson("round_section", nu)
    m2 = (inner_radius / radius) ** 2
    area = math.pi * radius**2 * (1 - m2)
    second_moment = math.pi / 4 * radius**4 * (1 - m2**2)
    whole = (7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2
    shear = 6 * (1 + nu) * (1 + m2) ** 2 / whole
    return Section(area, second_moment, second_moment, 2 * second_moment, shear, shear)


def rectangular_section(width: float, height: float, nu: float) -> Section:
    """Return the section of a solid rectangular bar.

    Args:
        width: [m] width along y, > 0.
        height: [m] height along z, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5), which determines the shear factor.

    Returns:
        The section.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of range.

    Sources:
        Cowper (1966) for the shear factor; Timoshenko & Goodier, *Theory of
        Elasticity*, section 109, for Saint-Venant's torsion series.
    """
    check_positive("rectangular_section", "width", width)
    check_positive("rectangular_section", "height", height)
    check_poisson("rectangular_section", nu)
    shear = 10 * (1 + nu) / (12 + 11 * nu)
    return Section(
        area=width * height,
        I_y=width * height**3 / 12,
        I_z=height * width**3 / 12,
        J=_rectangle_torsion(width, height),
        shear_y=shear,
        shear_z=shear,
    )


def _rectangle_torsion(width: float, height: float) -> float:
    """Evaluate Saint-Venant's series for the torsion constant [m^4]."""
    long, short = max(width, height), min(width, height)
    odd = np.arange(1.0, 2001.0, 2.0)
    # tanh is nearly 1 except in the first terms, so the terms decrease as n^-5
    tail = np.sum(np.tanh(odd * math.pi * long / (2 * short)) / odd**5)
    return long * short**3 / 3 * (1 - 192 / math.pi**5 * short / long * float(tail))


def box_section(width: float, height: float, wall: float, nu: float) -> Section:
    """Return the section of a rectangular tube with walls of equal thickness.

    Args:
        width: [m] outer width, along y.
        height: [m] outer height, along z (up).
        wall: [m] wall thickness, less than half of the width and half of the height.
        nu: [-] Poisson's ratio.

    Returns:
        The section. The torsion constant is the sum of the constants of a closed and of
        an open thin wall. The shear factors are valid for thin walls.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of range.

    Sources:
        Bredt (1896) for torsion; Cowper (1966) for the shear factor of a thin box.
    """
    _check(width=width, height=height, wall=wall)
    check_poisson("box_section", nu)
    if not 2 * wall < min(width, height):
        raise BadInput(
            f"box_section: found wall = {wall:g} m, expected less than half of the "
            "width and half of the height"
        )
    inner_width, inner_height = width - 2 * wall, height - 2 * wall
    b, h = width - wall, height - wall
    return Section(
        area=width * height - inner_width * inner_height,
        I_y=(width * height**3 - inner_width * inner_height**3) / 12,
        I_z=(height * width**3 - inner_height * inner_width**3) / 12,
        J=2 * wall * (b * h) ** 2 / (b + h) + 2 * (b + h) * wall**3 / 3,
        shear_y=_box_shear(along=b, across=h, nu=nu),
        shear_z=_box_shear(along=h, across=b, nu=nu),
    )


def _box_shear(along: float, across: float, nu: float) -> float:
    """Return Cowper's shear factor of a thin-walled rectangular tube."""
    # the walls are equally thick, so areas are proportional to side lengths
    m = n = across / along
    top = 10 * (1 + nu) * (1 + 3 * m) ** 2
    plain = 12 + 72 * m + 150 * m**2 + 90 * m**3
    poisson = 11 + 66 * m + 135 * m**2 + 90 * m**3
    wide = 10 * n**2 * ((3 + nu) * m + 3 * m**2)
    return top / (plain + nu * poisson + wide)


def i_section(
    width: float, height: float, web: float, flange: float, nu: float
) -> Section:
    """Return the section of an I-beam with equal flanges and a web along z.

    Args:
        width: [m] width of the flanges, along y.
        height: [m] total height, along z.
        web: [m] thickness of the web, less than the width.
        flange: [m] thickness of a flange, less than half of the height.
        nu: [-] Poisson's ratio.

    Returns:
        The section. The torsion constant is valid for an open thin wall that is free to
        warp. For a shear force along y, the section consists of two rectangular
        flanges.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of range.

    Sources:
        Cowper (1966) for the shear factors of a thin-walled I-section and of a
        rectangle.
    """
    _check(width=width, height=height, web=web, flange=flange)
    check_poisson("i_section", nu)
    if not (web < width and 2 * flange < height):
        raise BadInput(
            f"i_section: found web = {web:g} m and flange = {flange:g} m, "
            "expected web < width and 2 flange < height"
        )
    clear, h = height - 2 * flange, height - flange
    area = 2 * width * flange + clear * web
    m, n = 2 * width * flange / (h * web), width / h
    top = 10 * (1 + nu) * (1 + 3 * m) ** 2
    plain = 12 + 72 * m + 150 * m**2 + 90 * m**3
    poisson = 11 + 66 * m + 135 * m**2 + 90 * m**3
    wide = 30 * n**2 * (m + m**2) + 5 * nu * n**2 * (8 * m + 9 * m**2)
    flanges = 2 * width * flange / area
    return Section(
        area=area,
        I_y=(width * height**3 - (width - web) * clear**3) / 12,
        I_z=(2 * flange * width**3 + clear * web**3) / 12,
        J=(2 * width * flange**3 + h * web**3) / 3,
        shear_y=flanges * 10 * (1 + nu) / (12 + 11 * nu),
        shear_z=top / (plain + nu * poisson + wide),
    )


def declared_section(given: Mapping[str, float], nu: float) -> Section:
    """Create a section from its dimensions or constants.

    Args:
        given: values by name [m, m^2, m^4]. A round section has ``radius`` and
            optionally ``inner_radius``. A rectangle has ``width`` and ``height``, a
            rectangular tube also has ``wall``, and an I-section also has ``web`` and
            ``flange``. Any other section has the attributes of :class:`Section`.
        nu: [-] Poisson's ratio.

    Returns:
        The section.
    """
    if "radius" in given:
        return round_section(given["radius"], nu, given.get("inner_radius", 0.0))
    if "wall" in given:
        return box_section(given["width"], given["height"], given["wall"], nu)
    if "web" in given:
        return i_section(
            given["width"], given["height"], given["web"], given["flange"], nu
        )
    if "width" in given:
        return rectangular_section(given["width"], given["height"], nu)
    return Section(**given)


def check_section(place: str, given: Mapping[str, float]) -> None:
    """Check the names and values that describe a section.

    Args:
        place: name of the key, for error messages.
        given: values by name, see :func:`declared_section`.

    Raises:
        BadInput: a name is unknown or missing, or a value is invalid.
    """
    if set(given) in _SECTIONS:
        for name, value in given.items():
            if not (value == 0 or 1e-40 <= abs(value) <= LARGEST):
                raise BadInput(
                    f"{place}.{name}: found {value:g}, expected 0 or a size "
                    f"from 1e-40 to {LARGEST:g} in SI units"
                )
        return
    known = set().union(*_SECTIONS)
    for name in given:
        if name not in known:
            raise BadInput(f'{place}: unknown "{name}"{nearest(name, known)}')
    kinds = "; ".join(", ".join(sorted(kind)) for kind in _SECTIONS)
    raise BadInput(
        f"{place}: found {', '.join(given) or 'nothing'}, expected one of these sets: "
        f"{kinds}"
    )


def check_material(who: str, E: float, nu: float) -> None:
    """Check the elastic constants of an isotropic material.

    Args:
        who: name of the part, for error messages.
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.

    Raises:
        BadInput: E is not finite and positive, or nu is not in (-1, 0.5).
    """
    check_positive(who, "E", E)
    check_poisson(who, nu)


def check_poisson(who: str, nu: float) -> None:
    """Check that Poisson's ratio is between -1 and 0.5."""
    if not -1.0 < nu < 0.5:
        raise BadInput(f"{who}: nu = {nu:g} must lie between -1.0 and 0.5")


def check_positive(who: str, name: str, value: float) -> None:
    """Check that a number is finite and positive."""
    if not (math.isfinite(value) and value > 0):
        raise BadInput(f"{who}: {name} = {value:g} must be finite and > 0")


def _check(**lengths: float) -> None:
    """Check that all dimensions are finite and positive."""
    for name, value in lengths.items():
        if not 0 < value < float("inf"):
            raise BadInput(f"section: {name} = {value:g} m must be finite and > 0")
