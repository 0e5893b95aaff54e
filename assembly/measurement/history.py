"""Measurements of a campaign in order of time.

Some effects depend on earlier measurements.  For example, the temperature of a body
lags behind that of the air.  Each value is assumed to be constant since the previous
measurement, or since time 0.

Sources:
    Ljung, System Identification, section 2 (sampling of a first-order lag).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

STILL = 1e-9  # [rad, m] changes of a command below this value are ignored


@dataclass(frozen=True, eq=False)
class History:
    """Variables of H measurements, sorted by session and by time.

    Attributes:
        values: (H,) values of each variable by name; NaN if unknown.
        first: (H,) bool, True for the first reading of a session.
    """

    values: Mapping[str, NDArray]
    first: NDArray

    def direction(self, name: str) -> NDArray:
        """Return the direction of the last change of a variable: -1, 1 or 0 (unknown).

        Args:
            name: name of the variable.

        Returns:
            (H,) signs, 0 if unknown.  While a variable does not change, its previous
            direction remains valid.  Before the first change, the column ``approach``
            is used if available.
        """
        given = np.nan_to_num(self.values["approach"])
        if name == "approach":
            return given
        step = np.diff(self.values[name], prepend=np.nan)
        moved = ~self.first & (np.abs(step) > STILL)
        rows = np.arange(len(step))
        last = np.maximum.accumulate(np.where(moved, rows, -1))
        begin = np.maximum.accumulate(np.where(self.first, rows, -1))
        known = last >= begin
        return np.where(known, np.sign(step[last]), given)

    def slip(self, name: str, depth: float) -> NDArray:
        """Return the position of a friction element that moves with a variable.

        Args:
            name: name of the variable.
            depth: change of the variable that moves the element from its centre to one
                end, > 0.

        Returns:
            (H,) positions from -1 to 1.  The element moves with the variable until it
            reaches an end, and stays there until the variable changes direction.  At
            the beginning of a session, it is at the end given by ``approach``, or at
            its centre.

        Sources:
            Krasnosel'skii, Pokrovskii, Systems with Hysteresis, section 2 (stop).
        """
        step = np.diff(self.values[name], prepend=np.nan) / depth
        begin = np.nan_to_num(self.values["approach"])
        state, stands = 0.0, np.empty(len(step))
        for i, change in enumerate(step.tolist()):
            moved = begin[i] if self.first[i] else state + change
            state = min(1.0, max(-1.0, moved))
            stands[i] = state
        return stands

    def lagged(self, name: str, time_constant: float, *, held: bool = False) -> NDArray:
        """Return a variable with a first-order lag that starts from zero at time 0.

        Args:
            name: name of the variable.
            time_constant: [s] time constant, > 0.
            held: whether the variable is constant between readings, as a load is.  If
                False, it varies linearly between readings, as a temperature does.

        Returns:
            (H,) lagged values in the unit of the variable.
        """
        u, state = self.values[name], 0.0
        past = self._elapsed / time_constant
        decay = np.exp(-past)
        # (1 - e^-r) / r, the fraction of a linear change by which the state lags; 1 for
        # r = 0
        share = np.where(
            past > 0, -np.expm1(-past) / np.where(past > 0, past, 1.0), 1.0
        )
        even = ~self.first & (not held)
        response = np.empty(len(u))
        for i, value in enumerate(u.tolist()):
            if self.first[i]:
                state = 0.0
            before = float(u[i - 1]) if even[i] else value
            # This step is exact if the variable changes linearly.
            late = (value - before) * share[i]
            state = value - late + (state - before) * decay[i]
            response[i] = state
        return response

    def fading(self, time_constant: float) -> NDArray:
        """Return exp(-time / time constant), (H,)."""
        return np.exp(-self.values["time"] / time_constant)

    @cached_property
    def _elapsed(self) -> NDArray:
        """Time since the previous reading, or since time 0, (H,) [s]."""
        time = self.values["time"]
        return np.where(self.first, time, np.diff(time, prepend=0.0))


def in_order(
    values: Mapping[str, NDArray], session: NDArray | None
) -> tuple[History, NDArray]:
    """Sort H readings by session and by the time of measurement.

    Args:
        values: (H,) values of each variable in H readings, by name.  ``time`` must be
            included.  Readings without a time remain in the given order.
        session: (H,) session name of each reading; None if there is a single session.

    Returns:
        The sorted readings, and the index of each given reading among them, (H,).
    """
    time = np.nan_to_num(values["time"])
    names = np.zeros(len(time)) if session is None else session
    _, begins, number = np.unique(names, return_index=True, return_inverse=True)
    order = np.lexsort((time, begins[number]))  # stable sort
    first = np.diff(number[order], prepend=-1) != 0
    row = np.empty_like(order)
    row[order] = np.arange(len(order))
    return History({k: v[order] for k, v in values.items()}, first), row
