"""Platform loads given as six numbers or by component, for example ``{"fz": -50}``."""

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
    """Convert a load to an array.

    Args:
        load: array ``[mx my mz fx fy fz]`` (..., 6) [N m, N], or a mapping from these
            component names to numbers.  Each value in the mapping is a single number or
            an array with one number for each of k points.  Omitted components are zero.
        whose: name of the argument, for error messages.

    Returns:
        Wrench (..., 6) [N m, N]; (6,) or (k, 6) for a mapping.

    Raises:
        BadInput: a component is unknown, or its value is not a finite number of
            magnitude at most 1e40.
    """
    if not isinstance(load, Mapping):
        return np.array(load, dtype=float)
    check_components(load, whose, COMPONENTS)
    given = {name: _numbers(load[name], whose, name) for name in load}
    try:
        shape = np.broadcast_shapes(*(values.shape for values in given.values()))
    except ValueError:
        counts = ", ".join(f"{name} {values.size}" for name, values in given.items())
        expected = "expected the same number of values for each component, or one"
        raise BadInput(f"{whose}: found {counts} numbers, {expected}") from None
    wrench = np.zeros((*shape, 6))
    for name, values in given.items():
        wrench[..., COMPONENTS.index(name)] = values
    return wrench


def one_load(load: Load) -> NDArray:
    """Convert a single load to an array (6,) [N m, N].

    Args:
        load: see :func:`given_load`.

    Returns:
        Wrench (6,) [N m, N].

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
    """Convert the values of a component to an array."""
    expected = f"expected a number [{'N m' if name.startswith('m') else 'N'}]"
    whose = f"{whose} {name}"
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{whose}: found {describe(value)}, {expected}") from None
    if numbers.ndim > 1 or not (np.abs(numbers) <= LARGEST).all():
        raise BadInput(
            f"{whose}: found {describe(value)}, {expected} of magnitude at most "
            f"{LARGEST:g}"
        )
    return numbers
