"""Compute the sensitivity of the readings to candidate functions.

======  ===============  =========  ==================================================
symbol  code             shape      meaning
======  ===============  =========  ==================================================
a       ``sensitivity``  (R, 6)     change of the reading per unit of a component
P       ``basis``        (R, p)     columns of a form in a variable
T       ``mixed``        (p, q)     coefficients of the form per unknown of the search
======  ===============  =========  ==================================================

A component of a candidate contributes a times the row of P T times the unknowns to the
readings of a row.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.forms import FORMS, roughness
from forcefit.assembly.effects.functions import AXES, along, basis, unit_screw
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.measurement.variables import LOADS
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    is_known,
    is_turn,
)
from forcefit.validation.diagnosis.function_forms import CandidateShape
from forcefit.validation.diagnosis.responses import Responses

# Prior size of the linear part of a spline per knot interval, relative to the spline.
_STIFF = 0.1
# Powers are dropped if their size after removing lower powers is below this fraction.
_RANK = 1e-8
# Step of the derivative relative to the largest load; the model is linear in the load.
_STEP = 1e-3
_BENT = 64  # number of cached columns of forms with a fitted shape parameter
# Unknowns below this fraction of the largest one leave the readings unaffected.
_NOTHING = 1e-9


class Sensitivities:
    """Derivatives of the readings by components at any place, and variable values."""

    def __init__(self, conditions: Conditions, response: Responses) -> None:
        """Store the declared conditions of R rows and their responses."""
        self.conditions, self._response = conditions, response
        self.rows = np.arange(len(conditions))
        self._origin = conditions.postures.platform[:, :3, 3]
        self.basis = lru_cache(maxsize=None)(self._basis)
        self._raw = lru_cache(maxsize=_BENT)(self._unmixed)

    def take(self, rows: NDArray) -> "Sensitivities":
        """Select rows without renormalising the forms."""
        other = copy(self)
        other.rows, other._origin = self.rows[rows], self._origin[rows]
        r = self._response
        other._response = Responses(r.reading[rows], r.screws[rows], r.wrenches[rows])
        return other

    def about(self, conditions: Conditions, response: Responses) -> "Sensitivities":
        """Return the sensitivities for conditions that effects have changed.

        The normalisation of the forms stays unchanged.
        """
        other = copy(self)
        other.conditions, other._response = conditions, response
        return other

    @property
    def wrenches(self) -> NDArray:
        """(R, n, 6) [N m, N] declared wrench through every joint, in its axes."""
        return self._response.wrenches

    @cached_property
    def under_load(self) -> NDArray:
        """(all, 6, 6) change of every reading per unit of a component of the load."""
        change = np.zeros((len(self.conditions), 6, 6))
        still = predict(self.conditions).deviation
        size = max(float(np.abs(self.conditions.load).max()), 1.0)
        for k in range(6):
            load = self.conditions.load + _STEP * size * np.eye(6)[k]
            more = predict(replace(self.conditions, load=load)).deviation
            change[:, :, k] = np.nan_to_num((more - still) / (_STEP * size))
        return change

    def sensitivity(self, where: str, component: str, kind: str) -> NDArray:
        """Return changes (R, 6) of the reading per unit of a component at a place."""
        if where == "load":
            return self.under_load[self.rows, :, LOADS.index(component)]
        robot, response = self.conditions.robot, self._response
        return sensitivity_at(where, component, kind, robot, response, self._origin)

    def _basis(
        self, variables: tuple[str, ...], shape: CandidateShape
    ) -> tuple[NDArray, NDArray]:
        """Return the columns (R, q) of a form, scaled to order one, and T (p, q)."""
        raw = self._unmixed(variables, shape)
        size = np.sqrt(np.mean(raw**2, axis=0))
        mixed = np.diag(1 / np.where(size > 0, size, 1.0))
        if shape.form == "powers" and len(shape.names) > 1:
            # QR decomposition removes the lower powers from each power.
            Q, R = np.linalg.qr(raw * np.diag(mixed))
            # At most as many powers can be determined as there are rows.
            good = np.flatnonzero(np.abs(np.diag(R)) > _RANK * np.sqrt(len(raw)))
            mixed = mixed[:, good] @ np.linalg.inv(R[np.ix_(good, good)])
            mixed *= np.sqrt(len(raw))
        elif shape.form == "spline":
            # The prior of the spline values penalises rough splines.
            stiff = roughness(len(shape.names)) + _STIFF * np.eye(len(shape.names))
            mixed = np.linalg.inv(np.linalg.cholesky(stiff)).T
            mixed /= np.sqrt(np.mean((raw @ mixed) ** 2) * mixed.shape[1])
        elif shape.form.endswith(("waves", "slow_wave")) and len(variables) == 1:
            mixed = np.eye(len(shape.names))
        return raw @ mixed, mixed

    def _unmixed(self, variables: tuple[str, ...], shape: CandidateShape) -> NDArray:
        """Return the columns (R, p) of a form of variables."""
        if variables[0].startswith("wrench."):
            wrench = [self._wrench(*variables)]
            return FORMS[shape.form].basis(shape.names, wrench, dict(shape.given))
        anywhere = CandidatePart("reading", ("tx",), *variables)
        (function,) = Candidate((anywhere,), "screw", shape).functions()
        raw = np.nan_to_num(basis(self.conditions, function, shape.names))
        raw[~is_known(self.conditions, *variables)] = 0.0
        return raw

    def _wrench(self, name: str) -> NDArray:
        """Return the load (R,) [N m or N] of a joint in the declared model."""
        frame, _, component = name.removeprefix("wrench.").rpartition(".")
        row = self.conditions.robot.index(frame)
        return self._response.wrenches[:, row, LOADS.index(component)]

    def changes(self, one: Candidate, x: NDArray | None = None) -> NDArray:
        """Return the contribution (R, 6, m) [rad, m] of a candidate per unknown.

        The contribution is linearised at the values ``x`` (m,) of the unknowns.  If
        ``x`` is (m + 1,), its last value is the change of the shape parameter, and the
        result contains a column for this parameter.
        """
        m = len(self.axes(one))
        by = 0.0 if x is None or len(x) == m else float(x[-1])
        # Values of one unknown are stored contiguously, because they are read together.
        blocks = [columns.T[:, :, None] * s for s, columns in self._factors(one, by)]
        if x is not None and len(x) > m:
            step = _STEP * float(one.shape.bends[0])
            more, less = (self.moved(one, x[:m], by + s) for s in (step, -step))
            blocks.append((more - less)[None] / (2 * step))
        return np.moveaxis(np.concatenate(blocks), 0, 2)

    def moved(self, one: Candidate, x: NDArray, by: float = 0.0) -> NDArray:
        """Return the contribution (R, 6) [rad, m] of a candidate with unknowns x (m,).

        The shape parameter is increased by ``by``.
        """
        total, at = np.zeros((len(self.rows), 6)), 0
        for sensitivity, columns in self._factors(one, by):
            own = slice(at, at + columns.shape[1])
            at = own.stop
            total += sensitivity * (columns @ x[own])[:, None]
        return total

    def axes(self, one: Candidate) -> NDArray:
        """Return the screw component (m,) in which each unknown of a candidate acts."""
        counts = [columns.shape[1] for _, columns in self._factors(one)]
        components = [c for part in one.parts for c in part.components]
        kinds = [0 if is_turn(c) else 3 for c in components]
        numbers = [
            AXES.index(c) if c in AXES else k
            for c, k in zip(components, kinds, strict=True)
        ]
        return np.repeat(numbers, counts)

    def _factors(
        self, one: Candidate, by: float = 0.0
    ) -> Iterator[tuple[NDArray, NDArray]]:
        """Yield two factors for each component: (R, 6), and (R, q) of its unknowns."""
        for part in one.parts:
            columns, mixed = self.basis(part.variables, one.shape)
            if by:
                columns = self._raw(part.variables, one.shape.bent(by)) @ mixed
            columns = columns[self.rows]
            for component in part.components:
                yield self.sensitivity(part.where, component, one.kind), columns

    def fitted(self, one: Candidate, x: NDArray, std: NDArray) -> list[Function]:
        """Return robot-file functions with fitted coefficients.

        A candidate may act at several places, called parts.  Each part on which the
        readings depend yields one function, or one per session if a variable is unknown
        in some sessions.  ``x`` is (m,) or (m + 1,), see :meth:`changes`.  ``std``
        contains the standard deviations, treated as independent.
        """
        functions, at = [], 0
        m, given, sure = len(self.axes(one)), dict(one.shape.given), {}
        if len(x) > m:
            ((key, _),) = one.shape.given
            given, sure = dict(one.shape.bent(float(x[m])).given), {key: float(std[m])}
            x = x[:m]
        least = _NOTHING * np.abs(x).max(initial=0.0)
        for part, function in zip(one.parts, one.functions(), strict=True):
            _, mixed = self.basis(part.variables, one.shape)
            numbers, spread = dict(given), dict(sure)
            shown = []  # components of the candidate on which the readings depend
            alone = len(part.components) == 1
            for component in part.components:
                own = slice(at, at + mixed.shape[1])
                at = own.stop
                if not np.any(np.abs(x[own]) > least):
                    continue
                shown.append(component)
                values = mixed @ x[own]
                stds = np.sqrt(mixed**2 @ std[own] ** 2)
                for name, v, s in zip(one.shape.names, values, stds, strict=True):
                    key = name if alone else f"{component}.{name}"
                    numbers[key], spread[key] = float(v), float(s)
            if len(shown) == 1 and not alone:
                begin = f"{shown[0]}."
                numbers = {k.removeprefix(begin): v for k, v in numbers.items()}
                spread = {k.removeprefix(begin): v for k, v in spread.items()}
            sessions = self._sessions(part.variables) if shown else ()
            functions += [
                replace(
                    function, components=tuple(shown), parameters=numbers, std=spread,
                    session=session,
                )
                for session in sessions
            ]  # fmt: skip
        return functions

    def _sessions(self, variables: tuple[str, ...]) -> tuple[str | None, ...]:
        """Return the sessions in which variables are known, or (None,) for all rows."""
        conditions = self.conditions
        if variables[0].startswith("wrench.") or conditions.session is None:
            return (None,)
        known = is_known(conditions, *variables)
        if known.all():
            return (None,)
        return tuple(dict.fromkeys(conditions.session[known].tolist()))


def sensitivity_at(
    where: str, component: str, kind: str,
    robot: Robot, response: Responses, origin: NDArray,
) -> NDArray:  # fmt: skip
    """Return changes (R, 6) of the reading per unit of a component at a place.

    The place is a frame, ``"base"`` or ``"reading"``.  ``origin`` (R, 3) [m] is the
    position of the platform.
    """
    unit = unit_screw(robot, where, component)
    if where == "reading":
        return np.broadcast_to(unit, (len(origin), 6))
    if where == "base":
        screw = np.tile(unit, (len(origin), 1))
        screw[:, 3:] += np.cross(screw[:, :3], origin)
        return np.einsum("rij,rj->ri", response.reading, screw)
    row = robot.index(where)
    sensitivity = along(robot, where, component, response.screws[:, :, row])
    if kind == "compliance":
        through = along(robot, where, component, response.wrenches[:, row])
        return sensitivity * through[:, None]
    return sensitivity


def in_cells(
    sensitivities: Sensitivities, one: Candidate, campaign: Campaign
) -> NDArray:
    """Return changes (N, m) of the measured cells per unknown, divided by sigma."""
    changes = np.moveaxis(sensitivities.changes(one), 2, 0) / campaign.sigma
    columns = changes.reshape(len(changes), -1)
    if not campaign.cells.all():
        columns = columns[:, campaign.cells.ravel()]
    return columns.T
