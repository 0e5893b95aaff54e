"""A load on the platform, as six numbers or by component: ``{"fz": -50}``."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.largest import LARGEST
from forcefit.inputs.assignments import check_components
from forcefit.inputs.errors import BadInput, describe
from forcefit.inputs.number_arrays import find_fault
from forcefit.stiffness.screws import WRENCH

Load = ArrayLike | Mapping[str, ArrayLike]
COMPONENTS = tuple(name.lower() for name in WRENCH)


def given_load(load: Load, whose: str = "load") -> NDArray:
    """Return a load as an array.

    Args:
        load: (..., 6) [N m, N] ``[mx my mz fx fy fz]``; or a mapping from the names of
            these components to numbers.  Each value is one number, or one number for
            each of k points.  Components that are not given are zero.
        whose: name of the argument, with which error messages begin.

    Returns:
        (..., 6) [N m, N]; (6,) or (k, 6) for a mapping.

    Raises:
        BadInput: a component is unknown, or is not a finite number of at most 1e40; the
            message names the component.
    """
    if not isinstance(load, Mapping):
        return np.array(load, dtype=float)
    check_components(load, whose, COMPONENTS)
    given = {name: _numbers(load[name], whose, name) for name in load}
    try:
        shape = np.broadcast_shapes(*(values.shape for values in given.values()))
    except ValueError:
        counts = ", ".join(f"{name} {values.size}" for name, values in given.items())
        expected = "expected one number per component, or equally many"
        raise BadInput(f"{whose}: found {counts} numbers, {expected}") from None
    wrench = np.zeros((*shape, 6))
    for name, values in given.items():
        wrench[..., COMPONENTS.index(name)] = values
    return wrench


def one_load(load: Load) -> NDArray:
    """Return one load as an array (6,) [N m, N].

    Args:
        load: see :func:`given_load`.

    Returns:
        Six numbers.

    Raises:
        BadInput: the load is not six numbers or a mapping of components.
    """
    if isinstance(load, Mapping):
        load = given_load(load)
    fault = find_fault(np.asarray(load).tolist(), (6,))
    if fault:
        raise BadInput(f"load: found {fault}, expected 6 numbers [N m, N]")
    return np.array(load, dtype=float)


def _numbers(value: ArrayLike, whose: str, name: str) -> NDArray:
    """Return the value or values of a component as an array."""
    expected = f"expected a number [{'N m' if name.startswith('m') else 'N'}]"
    whose = f"{whose} {name}"
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{whose}: found {describe(value)}, {expected}") from None
    if numbers.ndim > 1 or not (np.abs(numbers) <= LARGEST).all():
        raise BadInput(
            f"{whose}: found {describe(value)}, {expected} of size at most {LARGEST:g}"
        )
    return numbers
