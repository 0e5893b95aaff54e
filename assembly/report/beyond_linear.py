"""Remarks on an exact equilibrium that the linear model does not predict."""

import numpy as np

from assembly.exact.exact import ExactAssembly

# of the platform's motion, and of the energy or the potential: links that turn by 0.1
# rad are off by less, and where clearances are taken up these are not
_FAR = 0.3


def far_from_linear(assembly: ExactAssembly) -> list[str]:
    """A remark on a loaded robot that may stand beyond a critical load.

    It may be stable there, as a column is that has buckled, and nothing in its balance
    shows that it has.

    Args:
        assembly: with finite motions.

    Returns:
        One sentence, or none.
    """
    if not (assembly.load.any() or assembly.loads.beyond_platform):
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
        f"far from the linear model, by {100 * off / moved:.0f} % of the motion: this "
        "may lie beyond a critical load (assembly deflection --state exact or --follow)"
    ]
