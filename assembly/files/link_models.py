"""Link models that other distributions install, by entry points.

A distribution names a function for a kind of link::

    [project.entry-points."forcefit.link_models"]
    cone = "their_package:cone"

``cone(span, values)`` returns K_E, (6, 6) [N m/rad .. N/m], at the end of the link in
the axes of its frame. ``span`` is the vector (3,) [m] from the start of the link to its
end, in these axes. ``values`` contains the numbers and texts that the robot file states
for the link.  A ``BadInput`` that the function raises is the message for the user.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import MatrixLink
from forcefit.inputs.entry_points import installed_names, load_installed, naming_owner
from forcefit.inputs.table import BadInput, Table, nearest, quoted
from forcefit.stiffness.link import check_definite

GROUP = "forcefit.link_models"


def model_link(link: Table, span: NDArray) -> MatrixLink:
    """Return the link of ``model = { name, ... }``.

    Args:
        link: the link's table.
        span: (3,) [m] from the start of the link to its end, in the frame's axes.

    Returns:
        The link, with the stiffness that the model computes.

    Raises:
        BadInput: no installed distribution has this model, it cannot be imported, or
            its result is not a stiffness matrix.
    """
    inner = link.table("model")
    name, names = inner.text("name"), installed_names(GROUP)
    if name not in names:
        hint = nearest(name, names) or "; none is installed"
        fault = (
            f"found {quoted(name)}, expected a link model of an installed package{hint}"
        )
        raise inner.bad("name", fault)
    values = {key: value for key, value in inner.content.items() if key != "name"}
    try:
        compute, words = load_installed(GROUP, name, "link model")
        K = _computed(compute, words, span, values)
    except BadInput as error:
        raise inner.bad("", str(error)) from None
    return MatrixLink((K + K.T) / 2)


def _computed(compute: Any, words: str, span: NDArray, values: dict) -> NDArray:
    """Return the (6, 6) stiffness that a link model computes, after a check."""
    found = naming_owner(compute, words)(span, values)
    try:
        K = np.asarray(found, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(
            f"{words} returned no array of numbers, expected a (6, 6) array"
        ) from None
    if K.shape != (6, 6) or not np.isfinite(K).all():
        raise BadInput(
            f"{words} returned an array of shape {K.shape}, expected (6, 6) of finite "
            "numbers"
        )
    check_definite(f"{words}: stiffness", K)
    return K
