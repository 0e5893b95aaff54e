"""Links as solid round bars: their stiffness by finite elements instead of a beam's.

The ends are rigid, as at a virtual joint: they can neither warp nor contract, which a
beam's can.  A bar's compliance depends on its
slenderness L / r and Poisson's ratio alone once it is read in units of L and E, so one
computation serves every link of one shape.
"""

import numpy as np
from numpy.typing import NDArray

from assembly.model.robot import BeamLink, Frame, beam_axis
from stiffness.beam.beam import section_axes
from stiffness.fem.fea import FemOptions, solve_link
from stiffness.fem.material import Material
from stiffness.surface.interface import parse_interface
from stiffness.surface.surface import Surface

FACETS = 64  # of the circle; the mesh's nodes lie on the circle itself


def bar_compliance(
    slenderness: float, poisson: float, accuracy: float = 0.005
) -> NDArray:
    """Tip compliance of a solid round bar of unit length and modulus along z.

    Args:
        slenderness: [-] length over radius.
        poisson: [-] Poisson's ratio.
        accuracy: [-] asked of the finite elements.

    Returns:
        (6, 6) at the tip's centre.

    Raises:
        BadInput: no mesh can be made, or a number is out of its range.
    """
    angle = 2 * np.pi * np.arange(FACETS) / FACETS
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) / slenderness
    points = np.vstack([ring, ring + [0, 0, 1], [[0, 0, 0], [0, 0, 1]]])
    i, j = np.arange(FACETS), np.roll(np.arange(FACETS), -1)
    base, tip = np.full(FACETS, 2 * FACETS), np.full(FACETS, 2 * FACETS + 1)
    triangles = np.vstack([
        np.column_stack(corners)
        for corners in (
            (i, j, j + FACETS), (i, j + FACETS, i + FACETS),
            (base, j, i), (tip, i + FACETS, j + FACETS),
        )
    ])  # fmt: skip
    surface = Surface(points, triangles, f"round bar of slenderness {slenderness:g}")
    ends = parse_interface("z=0"), parse_interface("z=1")
    material, options = Material(1.0, poisson), FemOptions(accuracy)
    solved = solve_link(surface, *ends, [material], options=options)
    return np.array(solved.link.compliance)


def bar_stiffness(frame: Frame, compliance: NDArray) -> NDArray:
    """K_E of a frame's beam were it a bar of known unit compliance.

    Args:
        frame: whose link is a beam; its length, axis and modulus count.
        compliance: (6, 6) of :func:`bar_compliance`.

    Returns:
        (6, 6) [N m/rad .. N/m] at the frame, in its axes.
    """
    assert isinstance(frame.link, BeamLink)
    length, axis = beam_axis(frame)
    x, y, z = section_axes(axis).T
    R = np.kron(np.eye(2), np.column_stack([y, z, x]))
    unit = np.repeat([length**-1.5, length**-0.5], 3)  # turns and shifts
    C = compliance * np.outer(unit, unit) / frame.link.young
    return np.linalg.inv(R @ C @ R.T)
