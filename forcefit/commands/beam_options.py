"""Options for the cross section, material and theory of a beam."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.commands.options import parse_assignments
from forcefit.inputs.errors import BadInput, checked, describe, nearest
from forcefit.stiffness.beam.beam import THEORIES, beam_compliance
from forcefit.stiffness.beam.sections import Section, check_section, declared_section
from forcefit.stiffness.link import LinkStiffness


@dataclass(frozen=True)
class BeamOptions:
    """Values of the beam options; None for options that are not given."""

    young: float
    poisson: float
    radius: float | None = None
    inner_radius: float | None = None
    width: float | None = None
    height: float | None = None
    section_text: str | None = None
    theory: str = "timoshenko"

    def has_section(self) -> bool:
        """Return whether at least one option describes a cross section."""
        lengths = (self.radius, self.inner_radius, self.width, self.height)
        return {*lengths, self.section_text} != {None}

    def material(self) -> tuple[float, float]:
        """Return Young's modulus [Pa] and Poisson's ratio."""
        E = checked("--young", self.young, "Pa", above=0)
        return E, checked("--poisson", self.poisson, "1", above=-1, below=0.5)

    def declared(self) -> dict[str, float]:
        """Return the dimensions [m] or constants of the cross section, by name."""
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
                raise BadInput(
                    f"--section: found together with --{name}; expected only one of "
                    "the two options"
                )
            constants = parse_assignments([self.section_text], "--section")
            check_section("--section", constants)
            return constants
        rectangle = "width" in given or "height" in given
        if ("radius" in given) == rectangle:
            raise BadInput(
                "found no unique cross section; expected either --radius, or --width "
                "and --height, or --section"
            )
        if rectangle and "inner_radius" in given:
            raise BadInput(
                "--inner-radius: found together with --width and --height; expected "
                "--radius for a tube (for a box, use --section "
                "width=...,height=...,wall=...)"
            )
        for name in ("width", "height") if rectangle else ("radius",):
            if name not in given:
                raise BadInput(
                    f"--{name}: missing; a rectangular section needs both --width and "
                    "--height [m]"
                )
            checked(f"--{name}", given[name], "m", above=0)
        if "inner_radius" in given:
            inner = given["inner_radius"]
            checked("--inner-radius", inner, "m", least=0, below=given["radius"])
        return given

    def section(self) -> Section:
        """Return the cross section described by the options, after validation."""
        _, nu = self.material()
        return declared_section(self.declared(), nu)

    def checked_theory(self) -> str:
        """Return the name of the beam theory; raise BadInput if it is unknown."""
        if self.theory not in THEORIES:
            raise BadInput(
                f"--theory: found {describe(self.theory)}"
                f"{nearest(self.theory, THEORIES)}"
            )
        return self.theory

    def link(
        self, base: NDArray, tip: NDArray, up: NDArray | None = None
    ) -> LinkStiffness:
        """Return the stiffness of a straight beam between two points [m]."""
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
    """Return the full name of a beam theory, as it is printed in results."""
    names = {"timoshenko": "Timoshenko beam", "euler": "Euler-Bernoulli beam"}
    return names[theory]
