"""Thresholds that the equations and their compiled counterparts share."""

RANK = 1e-10  # relative size below which a singular value counts as zero
ROWS_RANK = 1e-9  # the same among rows that only clearances can satisfy
# added to RANK for the rounding of robot files, times the nominal closure error left
MISMATCH_FACTOR = 30.0
# what a projection leaves of columns that it removes whole is rounding of their size
NOISE = 1e-12
UNBOUNDED = 1e-8  # [rad, m] of the platform for a unit of a motion nothing resists
OPEN = 1e-11  # [rad, reference lengths] most that a compiled solution leaves open
INFEASIBLE = (
    1e-13  # [rad, reference lengths] of the errors, where nothing can close them
)
MARGIN_GAP = 1e-8  # of a zone margin, accepted above its bound


def rank_tolerance(mismatch: float) -> float:
    """Relative size below which a singular value of closures counts as zero.

    Args:
        mismatch: [rad, m] nominal closure error left.

    Returns:
        The threshold.
    """
    return RANK + MISMATCH_FACTOR * mismatch
