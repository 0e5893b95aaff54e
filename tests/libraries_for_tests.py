"""Build file of a link library, and the exact stiffness of its round bars."""

from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import round_section
from forcefit.stiffness.link import inverted

GRID = {"length": (0.2, 0.3, 0.45), "radius": (0.01, 0.02, 0.04)}
MATERIAL = {"young": (6e10,), "poisson": (0.3,)}


def exact(length, radius, young=6e10, poisson=0.3):
    section = round_section(radius, poisson)
    return inverted(
        beam_compliance(length, section, young, poisson, axis=[0, 0, 1], up=[0, 1, 0])
    )


SPEC = """
library = "links"
shape = "round"
method = "beam"
[grid]
length = [0.2, 0.3]
radius = 0.01
young = 6e10
poisson = 0.3
"""
