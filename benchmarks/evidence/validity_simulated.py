"""Compute errors of ``crosscheck_validity.py`` by multibody simulation.

Run ``python benchmarks/evidence/validity_simulated.py``, which takes two minutes.  It
prints the last table of ``docs/validity.md``.  The simulation has geometrically exact
beams with weights at nine nodes, and two contacts for a pin in two bushes.
"""

from collections.abc import Iterator

import numpy as np
from crosscheck_validity import GRAVITY, POSES, free_of_errors, postures

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.validation.assumptions.bushes import solve_bushes
from forcefit.validation.crosscheck.spread_weight import energy_between_ends
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly

ELEMENTS = 8  # number of elements of each beam


def closures(at: Posture) -> tuple[float, ...]:
    """Return the errors [um] and [%] of the linear model and of the exact model."""
    assembly, exact = simulate_assembly(at), solve_exact(at)
    costs = []
    for model in (exact.linear, exact):
        shift = (assembly.platform_screw - model.platform_screw)[3:]
        energy = assembly.energy / model.energy - 1
        costs += [1e6 * float(np.linalg.norm(shift)), 100 * abs(energy)]
    return tuple(costs)


def weights(at: Posture) -> tuple[float, ...]:
    """Return the errors [um] and [%] of a model with weights at the ends of beams."""
    assembly = simulate_assembly(
        at, model=SimulationModel(elements=ELEMENTS), gravity=GRAVITY
    )
    ends = solve_assembly(at, gravity=GRAVITY)
    shift = (assembly.platform_screw - ends.platform_screw)[3:]
    whole = ends.energy + energy_between_ends(at, GRAVITY, ELEMENTS)
    return (
        1e6 * float(np.linalg.norm(shift)),
        100 * abs(1 - ends.energy / assembly.energy),
        100 * abs(1 - whole / assembly.energy),
    )


def discs(at: Posture) -> tuple[float, ...]:
    """Return the additional energy [%] of two bushes in both models."""
    by_cones = solve_bushes(at).energy / solve_assembly(at).energy
    disc, bushes = (
        simulate_assembly(
            at, 1 / 16, SimulationModel(clearances=True, bushes=b)
        ).rigid_energy
        for b in (False, True)
    )
    return 100 * (by_cones - 1), 100 * (bushes / disc - 1)


def cases(name: str) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield each comparison with its results."""
    for ratio in (None, 40.0):
        label = "as built" if ratio is None else "L / r = 40"
        for at in postures(name, ratio)[::5]:
            yield f"closures, {label}", closures(at)
    for ratio in (10.0, 40.0):
        for at in free_of_errors(postures(name, ratio))[:3]:
            yield f"weight, L / r = {ratio:g}", weights(at)
    for at in postures(name, play=True)[::5]:
        yield "bushes", discs(at)


def main() -> None:
    """Print medians and largest values of each comparison."""
    for name in POSES:
        rows: dict[str, list[tuple[float, ...]]] = {}
        for what, numbers in cases(name):
            rows.setdefault(what, []).append(numbers)
        for what, values in rows.items():
            columns = np.transpose(values)
            cells = [f"{np.median(c):.3g} ({c.max():.3g})" for c in columns]
            print(f"| {name} | {what} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
