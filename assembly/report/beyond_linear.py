"""Remark on equilibria that differ strongly from the linear solution."""

import numpy as np

from forcefit.assembly.exact.exact import ExactAssembly

# accepted relative difference between exact and linear solution in the platform motion
# and in the energy
_FAR = 0.3


def far_from_linear(assembly: ExactAssembly) -> list[str]:
    """Return a remark if a robot may be loaded beyond a critical load.

    A stability test is not sufficient, because the equilibrium of a buckled structure
    can be stable.

    Args:
        assembly: exact solution with finite rotations.

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
