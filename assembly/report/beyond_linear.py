"""Remark on exact equilibria that differ strongly from the linear solution."""

import numpy as np

from forcefit.assembly.exact.exact import ExactAssembly

# largest accepted relative difference between exact and linear model, for the platform
# motion and for the energy or potential. Link rotations of 0.1 rad cause smaller
# differences
_FAR = 0.3


def far_from_linear(assembly: ExactAssembly) -> list[str]:
    """Return a remark on a loaded robot that may be beyond a critical load.

    Such an equilibrium can be stable, like that of a buckled column, so a stability
    test does not detect it.

    Args:
        assembly: assembly with finite motions.

    Returns:
        A list with one sentence, or an empty list.
    """
    loads = assembly.loads
    if not (loads.load.any() or loads.beyond_platform or loads.drives.any()):
        return []
    scale = np.repeat([assembly.linear.linearisation.size, 1.0], 3)
    exact = scale * assembly.platform_screw
    off = np.linalg.norm(scale * assembly.linear.platform_screw - exact)
    moved = np.linalg.norm(exact)
    linear, there = assembly.linear.potential, assembly.potential
    energy = abs(assembly.linearisation_error.relative_energy)
    energy = max(energy, abs(linear - there) / max(abs(there), 1e-300))
    if not (off > _FAR * moved and energy > _FAR):
        return []
    return [
        f"the motion differs from the linear model by {100 * off / moved:.0f} %; this "
        "may be beyond a critical load (assembly deflection --state exact, --follow)"
    ]
