"""Link models from other distributions.

A distribution declares a function for a type of link as an entry point::

    [project.entry-points."forcefit.link_models"]
    cone = "their_package:cone"

``cone(span, values)`` returns the stiffness K_E at the end of the link in frame axes,
(6, 6) [N m/rad .. N/m]. ``span`` is the vector from the start to the end of the link in
frame axes, (3,) [m], and ``values`` contains the numbers and texts in the robot file.
The message of a ``BadInput`` error that the function raises is shown to the user.
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
    """Read ``model = { name, ... }`` and compute the link stiffness.

    Args:
        link: table of the link.
        span: vector from the start to the end of the link in frame axes, (3,) [m].

    Returns:
        Link with the computed stiffness.

    Raises:
        BadInput: no installed distribution provides this model, it cannot be imported,
            or its result is not a stiffness matrix.
    """
    inner = link.table("model")
    name, names = inner.text("name"), installed_names(GROUP)
    if name not in names:
        hint = nearest(name, names) or "; none is installed"
        fault = f"found {quoted(name)}, expected an installed link model{hint}"
        raise inner.bad("name", fault)
    values = {key: value for key, value in inner.content.items() if key != "name"}
    try:
        compute, words = load_installed(GROUP, name, "link model")
        K = _computed(compute, words, span, values)
    except BadInput as error:
        raise inner.bad("", str(error)) from None
    return MatrixLink((K + K.T) / 2)


def _computed(compute: Any, words: str, span: NDArray, values: dict) -> NDArray:
    """Compute and check the stiffness of a link model, (6, 6)."""
    found = naming_owner(compute, words)(span, values)
    try:
        K = np.asarray(found, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(
            f"{words} did not return an array of numbers, expected shape (6, 6)"
        ) from None
    if K.shape != (6, 6) or not np.isfinite(K).all():
        raise BadInput(
            f"{words} returned an array of shape {K.shape}, expected finite numbers of "
            "shape (6, 6)"
        )
    check_definite(f"{words}: stiffness", K)
    return K
