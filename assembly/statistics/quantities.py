"""Quantities that are computed for each draw, with units and limits."""

import numpy as np

from forcefit.inputs.table import BadInput, nearest
from forcefit.results.quantities import QUANTITIES

# unit of each quantity, in the order of reports
UNITS = {
    name: QUANTITIES[name].unit
    for name in (
        "energy", "duality_gap", "margin", "margin_free", "platform_screw", "rotation",
        "translation", "force", "moment", "stress", "rotation_lower",
        "translation_lower",
    )
}  # fmt: skip
POSE_ERRORS = ("rotation", "translation")
_UNLIMITED = {"platform_screw", "duality_gap", "rotation_lower", "translation_lower"}


def limit_names() -> tuple[str, ...]:
    """Return the names of quantities for which a limit is valid."""
    return tuple(k for k in UNITS if k not in _UNLIMITED)


def parse_limit(text: str) -> tuple[str, float]:
    """Return the quantity and the value of a limit such as ``"energy=5"``.

    Args:
        text: name, "=" and a number > 0. The names are energy [J], margin, margin_free,
            rotation [rad], translation [m], force [N], moment [N m] and stress [Pa].

    Returns:
        The name and the limit.

    Raises:
        BadInput: the text has a different form.
    """
    name, _, number = (piece.strip() for piece in text.partition("="))
    names = limit_names()
    if name not in names:
        raise BadInput(f'--limit: unknown quantity "{name[:60]}"{nearest(name, names)}')
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if not 0 < value < np.inf:
        raise BadInput(f'--limit {name}: found "{number[:60]}", expected a number > 0')
    return name, value
