"""Values of command line options, checked; every mistake names its option."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffness.beam import (
    THEORIES,
    Section,
    beam_compliance,
    rectangular_section,
    round_section,
)
from stiffness.link import LinkStiffness
from stiffness.reading import BadInput, describe, nearest

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def checked(
    option: str,
    value: float,
    unit: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    below: float = math.inf,
) -> float:
    """A finite number inside its range.

    Args:
        option: such as ``--length``, for the message.
        value: what was given.
        unit: for the message.
        above: the value must be larger.
        least: the value must not be smaller.
        below: the value must be smaller.

    Returns:
        The value.

    Raises:
        BadInput: it is not finite, or outside.
    """
    if math.isfinite(value) and above < value < below and value >= least:
        return value
    limits = [
        f"> {above:g}" if above > -math.inf else "",
        f">= {least:g}" if least > -math.inf else "",
        f"< {below:g}" if below < math.inf else "",
    ]
    expected = " ".join(["a finite number", *filter(None, limits), f"[{unit}]"])
    raise BadInput(f"{option}: found {value:g}, expected {expected}")


def direction(option: str, text: str) -> NDArray:
    """A direction as ``x``, ``-y`` or ``1,0,2``.

    Args:
        option: for the message.
        text: what was given.

    Returns:
        (3,) of any length but zero.

    Raises:
        BadInput: it is neither.
    """
    name = text.strip().lower()
    if name.lstrip("+-") in _AXES and len(name) <= 2:
        sign = -1.0 if name.startswith("-") else 1.0
        return sign * np.array(_AXES[name.lstrip("+-")])
    try:
        vector = np.array([float(part) for part in text.split(",")])
    except ValueError:
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise BadInput(
            f"{option}: found {describe(text)}, expected x, y, z or three numbers "
            "such as 0,0,1, not all zero"
        )
    return vector


def assignments(option: str, texts: list[str]) -> dict[str, float]:
    """Numbers by name, as ``a=1,b=2``, the option given once or more.

    Args:
        option: for the message.
        texts: what was given.

    Returns:
        Values by name.

    Raises:
        BadInput: a part is not a name and a finite number, or a name comes twice.
    """
    found: dict[str, float] = {}
    for part in ",".join(texts).split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not name or not math.isfinite(number):
            raise BadInput(f"{option}: found {describe(part)}, expected name=number")
        if name in found:
            raise BadInput(f"{option}: {name} is given twice")
        found[name] = number
    return found


@dataclass(frozen=True)
class BeamOptions:
    """What the command line says about a beam; absent values are None."""

    young: float
    poisson: float
    radius: float | None = None
    inner_radius: float | None = None
    width: float | None = None
    height: float | None = None
    theory: str = "timoshenko"

    def material(self) -> tuple[float, float]:
        """Young's modulus [Pa] and Poisson's ratio."""
        E = checked("--young", self.young, "Pa", above=0)
        return E, checked("--poisson", self.poisson, "1", above=-1, below=0.5)

    def section(self) -> Section:
        """The section that the options describe, or an error that says what lacks."""
        _, nu = self.material()
        rectangle = self.width is not None or self.height is not None
        if (self.radius is not None) == rectangle:
            raise BadInput("give either --radius, or --width and --height")
        if self.radius is not None:
            radius = checked("--radius", self.radius, "m", above=0)
            inner = self.inner_radius or 0.0
            inner = checked("--inner-radius", inner, "m", least=0, below=radius)
            return round_section(radius, nu, inner)
        if self.width is None or self.height is None:
            missing = "--width" if self.width is None else "--height"
            raise BadInput(f"{missing}: missing; a rectangle has both")
        if self.inner_radius is not None:
            raise BadInput("--inner-radius: goes with --radius, not with a rectangle")
        width = checked("--width", self.width, "m", above=0)
        return rectangular_section(
            width, checked("--height", self.height, "m", above=0), nu
        )

    def link(
        self, base: NDArray, tip: NDArray, up: NDArray | None = None
    ) -> LinkStiffness:
        """The beam between two points, in the axes they are given in."""
        E, nu = self.material()
        if self.theory not in THEORIES:
            raise BadInput(
                f"--theory: found {describe(self.theory)}"
                f"{nearest(self.theory, THEORIES)}"
            )
        section = self.section()
        C = beam_compliance(
            float(np.linalg.norm(tip - base)),
            section,
            E,
            nu,
            theory=self.theory,
            axis=tip - base,
            up=up,
        )
        names = {"timoshenko": "Timoshenko beam", "euler": "Euler-Bernoulli beam"}
        return LinkStiffness(names[self.theory], C, tip=tip, base=base)
