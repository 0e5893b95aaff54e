"""Values of command line options, checked; every mistake names its option."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from stiffness.beam import THEORIES, Section, beam_compliance, declared_section
from stiffness.link import LinkStiffness
from stiffness.reading import BadInput, comma_numbers, describe, nearest
from stiffness.screws import WRENCH

_SECTIONS = (
    {"radius"},
    {"radius", "inner_radius"},
    {"width", "height"},
    {"width", "height", "wall"},
    {"width", "height", "web", "flange"},
    {item.name for item in fields(Section)},
)
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

_LARGEST = 1e15  # in SI: beyond any length, modulus or density; its inverse below


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
        BadInput: it is not finite, outside, or beyond what machines are made of.
    """
    if math.isfinite(value) and above < value < below and value >= least:
        sane = abs(value) <= _LARGEST and (above != 0 or value >= 1 / _LARGEST)
        if not sane:
            raise BadInput(
                f"{option}: found {value:g}, expected a size between {1 / _LARGEST:g} "
                f"and {_LARGEST:g} [{unit}]"
            )
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
    vector = comma_numbers(text)
    if vector.shape != (3,) or not vector.any():
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


def wrench(option: str, texts: list[str]) -> NDArray:
    """A wrench as ``fx=10,mz=1``; components not named are zero.

    Args:
        option: for the message.
        texts: what was given.

    Returns:
        (6,) [N m, N].

    Raises:
        BadInput: a part is not a component and a finite number, or comes twice.
    """
    names = [name.lower() for name in WRENCH]
    found = np.zeros(6)
    for name, value in assignments(option, texts).items():
        if name not in names:
            hint = nearest(name, names)
            raise BadInput(f'{option}: unknown component "{name}"{hint}')
        found[names.index(name)] = value
    return found


def numbers(option: str, text: str, unit: str) -> list[float]:
    """Positive numbers between commas, smallest first, none twice.

    Args:
        option: for the message.
        text: what was given.
        unit: for the message.

    Returns:
        The numbers.

    Raises:
        BadInput: one is not a finite number > 0, or stands there twice.
    """
    try:
        found = sorted(float(part) for part in text.split(","))
    except ValueError:
        raise BadInput(
            f"{option}: found {describe(text)}, expected numbers such as 5,10,20"
        ) from None
    for one, other in zip(found, [*found[1:], math.inf], strict=True):
        checked(option, one, unit, above=0)
        if one == other:
            raise BadInput(f"{option}: {one:g} is given twice")
    return found


def check_section(place: str, given: Mapping[str, float]) -> None:
    """Refuse what describes no section.

    Args:
        place: where it stands, for the message.
        given: lengths or constants by name, see
            :func:`stiffness.beam.declared_section`.

    Raises:
        BadInput: a name belongs to no section, one lacks, or a value is of no section.
    """
    if set(given) in _SECTIONS:
        for name, value in given.items():
            if not (value == 0 or 1e-40 <= abs(value) <= _LARGEST):
                raise BadInput(f"{place}.{name}: found {value:g}, no size of a section")
        return
    known = set().union(*_SECTIONS)
    for name in given:
        if name not in known:
            raise BadInput(f'{place}: unknown "{name}"{nearest(name, known)}')
    kinds = "; ".join(", ".join(sorted(kind)) for kind in _SECTIONS)
    raise BadInput(
        f"{place}: found {', '.join(given) or 'nothing'}, expected one of: {kinds}"
    )


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
    section_text: str | None = None

    def material(self) -> tuple[float, float]:
        """Young's modulus [Pa] and Poisson's ratio."""
        E = checked("--young", self.young, "Pa", above=0)
        return E, checked("--poisson", self.poisson, "1", above=-1, below=0.5)

    def declared(self) -> dict[str, float]:
        """The section's lengths or constants by name; an error that says what lacks."""
        plain = {
            "radius": self.radius,
            "inner_radius": self.inner_radius,
            "width": self.width,
            "height": self.height,
        }
        given = {name: value for name, value in plain.items() if value is not None}
        if self.section_text is not None:
            if given:
                name = next(iter(given)).replace("_", "-")
                raise BadInput(f"--section: says it all, --{name} does not go with it")
            found = assignments("--section", [self.section_text])
            check_section("--section", found)
            return found
        rectangle = "width" in given or "height" in given
        if ("radius" in given) == rectangle:
            raise BadInput(
                "give either --radius, or --width and --height, or --section"
            )
        if rectangle and "inner_radius" in given:
            raise BadInput("--inner-radius: goes with --radius, not with a rectangle")
        for name in ("width", "height") if rectangle else ("radius",):
            if name not in given:
                raise BadInput(f"--{name}: missing; a rectangle has both")
            checked(f"--{name}", given[name], "m", above=0)
        if "inner_radius" in given:
            inner = given["inner_radius"]
            checked("--inner-radius", inner, "m", least=0, below=given["radius"])
        return given

    def section(self) -> Section:
        """The section that the options describe, or an error that says what lacks."""
        _, nu = self.material()
        return declared_section(self.declared(), nu)

    def checked_theory(self) -> str:
        """The name of a beam theory."""
        if self.theory not in THEORIES:
            raise BadInput(
                f"--theory: found {describe(self.theory)}"
                f"{nearest(self.theory, THEORIES)}"
            )
        return self.theory

    def link(
        self, base: NDArray, tip: NDArray, up: NDArray | None = None
    ) -> LinkStiffness:
        """The beam between two points, in the axes they are given in."""
        E, nu = self.material()
        theory = self.checked_theory()
        C = beam_compliance(
            float(np.linalg.norm(tip - base)),
            self.section(),
            E,
            nu,
            theory=theory,
            axis=tip - base,
            up=up,
        )
        return LinkStiffness(beam_name(theory), C, tip=tip, base=base)


def beam_name(theory: str) -> str:
    """What a result of a beam theory is called."""
    names = {"timoshenko": "Timoshenko beam", "euler": "Euler-Bernoulli beam"}
    return names[theory]
