"""The quantities of each draw: names, units, meanings, and limits on them."""

import numpy as np

from forcefit.inputs.table import BadInput, nearest

UNITS = {
    "energy": "J", "duality_gap": "J", "margin": "1", "margin_free": "1",
    "platform_screw": "rad, m", "rotation": "rad", "translation": "m", "force": "N",
    "moment": "N m", "stress": "Pa", "rotation_lower": "rad", "translation_lower": "m",
}  # fmt: skip
MEANINGS = {
    "energy": "least elastic energy that closes it, eq. (22)",
    "duality_gap": "certified: energy is at most this too high",
    "margin": "factor on all clearances at which it just assembles, compliant rigid",
    "margin_free": "the same, compliant joints free about their own axis",
    "platform_screw": "pose error at the platform's origin, base axes",
    "rotation": "size of the platform's rotation error",
    "translation": "size of the platform's translation error",
    "rotation_lower": "certified: the largest rotation error is at least this",
    "translation_lower": "certified: the largest translation error is at least this",
    "force": "largest force through any body",
    "moment": "largest moment through any body",
    "stress": "largest von Mises stress in the link",
    "stiffness": "of the platform along each axis, the others free; 0 where free",
    "free_motion": "of the platform, that nothing resists: unit screws, else NaN",
    "clearance_mixed": "1 where the walk that settles the clearances met its criterion",
    "status": "0 solved, 1 no answer",
}
POSE_ERRORS = ("rotation", "translation")
_UNLIMITED = {"platform_screw", "duality_gap", "rotation_lower", "translation_lower"}


def limit_names() -> tuple[str, ...]:
    """Return the quantities that may be limited."""
    return tuple(k for k in UNITS if k not in _UNLIMITED)


def parse_limit(text: str) -> tuple[str, float]:
    """Return the quantity and limit from text such as ``"energy=5"``.

    Args:
        text: one of energy [J], margin, margin_free, rotation [rad], translation [m],
            force [N], moment [N m], stress [Pa], and a number > 0.

    Returns:
        Both.

    Raises:
        BadInput: the text has another form.
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
