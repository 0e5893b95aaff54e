"""What the certificate of a least energy proves, and what it leaves unproved."""

import numpy as np
from numpy.typing import NDArray

from assembly.linear.assembled import Assembly
from assembly.linear.rounding import SPREAD, stiffness_spread
from assembly.linear.screw_bound import ScrewBound, bound_screw
from assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE

LARGEST_RESIDUAL = 1e-9  # [rad, reference lengths] accepted of a closure
LARGEST_EXCESS = 1e-9  # [-] accepted of a clearance
_SCREW, _SCREW_SHARE = 1e-5, 1e-3  # [rad, m], and of its size: accepted of the screw
_AMPLIFIED = 10.0  # factor by which closures may amplify what springs move


def unproved(assembly: Assembly) -> str:
    """What the certificate leaves unproved.

    Proved is an assembly that closes to 1e-9 (rad, or m per reference length), with
    clearances within 1e-9 of their bounds, whose energy is at most 1e-8 of it, and of
    the loads' work, plus 1e-12 of that without clearance above the least possible.

    Args:
        assembly: of least energy.

    Returns:
        Sentences joined by semicolons; empty if all is proved.
    """
    residual, excess, gap = (
        assembly.closure_residual(), assembly.clearance_excess(),
        assembly.duality_gap(),
    )  # fmt: skip
    allowed = GAP * (assembly.stored + abs(assembly.work))
    allowed += GAP_WITHOUT_CLEARANCE * assembly.energy_without_clearance
    sentences = []
    # written so that NaN is not proved
    if not gap <= allowed:
        sentences.append(
            f"the energy is proved least to {gap:.1e} J only, expected {allowed:.1e} J"
        )
    if not residual <= LARGEST_RESIDUAL:
        sentences.append(
            f"a closure stays open by {residual:.1e} (rad, or m per length)"
        )
    if not excess <= LARGEST_EXCESS:
        sentences.append(f"a clearance is exceeded by {excess:.1e} of its size")
    if not sentences and not _springs_determined(assembly):
        sentences += unproved_screw(assembly, bound_screw(assembly))
    return "; ".join(sentences)


def unproved_screw(assembly: Assembly, bound: ScrewBound) -> list[str]:
    """What of the platform screw the gap leaves unproved, where it is unique.

    Args:
        assembly: of least energy.
        bound: of its platform screw.

    Returns:
        A sentence for each half that is not proved to 1e-5 rad or m plus 1e-3 of it.
    """
    allowed = _allowed(assembly)
    spread = stiffness_spread(assembly.joints, assembly.linearisation.size)
    why = f"; stiffnesses differ {spread:.0e} times" if spread > SPREAD else ""
    return [
        f"the platform's {part} is proved to {error:.1e} {unit} only, expected "
        f"{most:.1e}{why}"
        for part, error, unit, most in (
            ("rotation", bound.rotation_error, "rad", allowed[0]),
            ("translation", bound.translation_error, "m", allowed[1]),
        )
        if not error <= most
    ]


def _allowed(assembly: Assembly) -> NDArray:
    """(2,) [rad, m] largest error accepted of the platform screw."""
    halves = assembly.platform_screw.reshape(2, 3)
    return _SCREW + _SCREW_SHARE * np.linalg.norm(halves, axis=1)


def _springs_determined(assembly: Assembly) -> bool:
    """Whether springs, as far as the gap leaves them open, hardly move a frame."""
    frames, springs = len(assembly.posture.robot.frames), assembly.elastic.size
    blocks = assembly.joints.elastic.reshape(frames, 6, springs)
    moved = np.linalg.norm(assembly.posture.paths @ blocks, axis=(0, 2))
    moved = np.linalg.norm(moved.reshape(2, 3), axis=1)
    distance = np.sqrt(2 * assembly.uncertainty) * moved
    return bool(np.all(_AMPLIFIED * distance <= _allowed(assembly)))
