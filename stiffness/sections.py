"""Sections of thin walls: hollow rectangles and I-beams."""

from stiffness.beam import Section, check_material
from stiffness.reading import BadInput


def box_section(width: float, height: float, wall: float, nu: float) -> Section:
    """Hollow rectangle of one wall thickness.

    Args:
        width: [m] outside, along y.
        height: [m] outside, along z (up).
        wall: [m] thickness, less than half of either.
        nu: [-] Poisson's ratio.

    Returns:
        The section; its torsion is that of a closed thin wall with the wall's own
        twist added, its shear factors those of thin walls.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of its range.

    Sources:
        Bredt (1896) for torsion; Cowper (1966) for the shear factor of a thin box.
    """
    _check(width=width, height=height, wall=wall)
    check_material("box_section", 1.0, nu)
    if not 2 * wall < min(width, height):
        raise BadInput(f"box_section: wall = {wall:g} m must leave a hole")
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
    """Cowper's thin box of one wall; force along ``along``."""
    m = n = across / along  # flange over web area of equal walls is the same ratio
    top = 10 * (1 + nu) * (1 + 3 * m) ** 2
    plain = 12 + 72 * m + 150 * m**2 + 90 * m**3
    poisson = 11 + 66 * m + 135 * m**2 + 90 * m**3
    wide = 10 * n**2 * ((3 + nu) * m + 3 * m**2)
    return top / (plain + nu * poisson + wide)


def i_section(
    width: float, height: float, web: float, flange: float, nu: float
) -> Section:
    """I-beam with equal flanges, the web along z (up).

    Args:
        width: [m] of the flanges, along y.
        height: [m] overall, along z.
        web: [m] thickness, less than the width.
        flange: [m] thickness, less than half the height.
        nu: [-] Poisson's ratio.

    Returns:
        The section; torsion is that of an open thin wall (warping free), shear along y
        is carried by the flanges as by two rectangles.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of its range.

    Sources:
        Cowper (1966) for the shear factors of a thin I and of a rectangle.
    """
    _check(width=width, height=height, web=web, flange=flange)
    check_material("i_section", 1.0, nu)
    if not (web < width and 2 * flange < height):
        raise BadInput("i_section: web or flange is thicker than the section allows")
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


def _check(**lengths: float) -> None:
    """All lengths must be positive and finite."""
    for name, value in lengths.items():
        if not 0 < value < float("inf"):
            raise BadInput(f"section: {name} = {value:g} m must be finite and > 0")
