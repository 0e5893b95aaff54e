"""Compute the sensitivity of the readings to candidate functions.

======  ===============  =========  ==================================================
symbol  code             shape      meaning
======  ===============  =========  ==================================================
a       ``sensitivity``  (R, 6)     change of the reading per unit screw component
P       ``basis``        (R, p)     basis functions of a functional form
T       ``mixed``        (p, q)     coefficients of the basis functions per unknown
======  ===============  =========  ==================================================

In row r, a screw component of a candidate function contributes a_r (P T)_r x to the
readings, where x are the unknowns.
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

# Weight of the squared spline values in the prior, relative to the roughness.
_STIFF = 0.1
# A power of a variable is omitted if the relative norm of its component orthogonal to
# all lower powers is smaller than this value.
_RANK = 1e-8
# Step of numerical derivatives, relative to the largest load or to a shape parameter.
_STEP = 1e-3
_BENT = 64  # number of functional forms whose basis functions are cached
# Unknowns below this fraction of the largest unknown are treated as zero.
_NOTHING = 1e-9


class Sensitivities:
    """Derivatives of the readings with respect to unknowns of functions."""

    def __init__(self, conditions: Conditions, response: Responses) -> None:
        """Store the conditions of R rows and their responses to unit screws."""
        self.conditions, self._response = conditions, response
        self.rows = np.arange(len(conditions))
        self._origin = conditions.postures.platform[:, :3, 3]
        self.basis = lru_cache(maxsize=None)(self._basis)
        self._raw = lru_cache(maxsize=_BENT)(self._unmixed)

    def take(self, rows: NDArray) -> "Sensitivities":
        """Return the sensitivities of selected rows.

        The normalisation of the functional forms does not change.
        """
        other = copy(self)
        other.rows, other._origin = self.rows[rows], self._origin[rows]
        r = self._response
        other._response = Responses(r.reading[rows], r.screws[rows], r.wrenches[rows])
        return other

    def about(self, conditions: Conditions, response: Responses) -> "Sensitivities":
        """Return the sensitivities for changed conditions.

        The normalisation of the functional forms does not change.
        """
        other = copy(self)
        other.conditions, other._response = conditions, response
        return other

    @property
    def wrenches(self) -> NDArray:
        """Declared wrench (R, n, 6) [N m, N] at every joint, joint axes."""
        return self._response.wrenches

    @cached_property
    def under_load(self) -> NDArray:
        """Change of every reading per unit of each load component, (all, 6, 6)."""
        change = np.zeros((len(self.conditions), 6, 6))
        still = predict(self.conditions).deviation
        size = max(float(np.abs(self.conditions.load).max()), 1.0)
        for k in range(6):
            load = self.conditions.load + _STEP * size * np.eye(6)[k]
            more = predict(replace(self.conditions, load=load)).deviation
            change[:, :, k] = np.nan_to_num((more - still) / (_STEP * size))
        return change

    def sensitivity(self, where: str, component: str, kind: str) -> NDArray:
        """Return the changes (R, 6) of the readings per unit of a screw component."""
        if where == "load":
            return self.under_load[self.rows, :, LOADS.index(component)]
        robot, response = self.conditions.robot, self._response
        return sensitivity_at(where, component, kind, robot, response, self._origin)

    def _basis(
        self, variables: tuple[str, ...], shape: CandidateShape
    ) -> tuple[NDArray, NDArray]:
        """Return the normalised basis functions P T (R, q), and T (p, q)."""
        raw = self._unmixed(variables, shape)
        size = np.sqrt(np.mean(raw**2, axis=0))
        mixed = np.diag(1 / np.where(size > 0, size, 1.0))
        if shape.form == "powers" and len(shape.names) > 1:
            # The QR decomposition makes each power orthogonal to the lower powers.
            Q, R = np.linalg.qr(raw * np.diag(mixed))
            # The number of powers that can be determined is limited by the number of
            # rows.
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
        """Return the basis functions P (R, p) of a functional form."""
        if variables[0].startswith("wrench."):
            wrench = [self._wrench(*variables)]
            return FORMS[shape.form].basis(shape.names, wrench, dict(shape.given))
        anywhere = CandidatePart("reading", ("tx",), *variables)
        (function,) = Candidate((anywhere,), "screw", shape).functions()
        raw = np.nan_to_num(basis(self.conditions, function, shape.names))
        raw[~is_known(self.conditions, *variables)] = 0.0
        return raw

    def _wrench(self, name: str) -> NDArray:
        """Return one component (R,) [N m or N] of a joint wrench."""
        frame, _, component = name.removeprefix("wrench.").rpartition(".")
        row = self.conditions.robot.index(frame)
        return self._response.wrenches[:, row, LOADS.index(component)]

    def changes(self, one: Candidate, x: NDArray | None = None) -> NDArray:
        """Return the changes of the readings per unknown of a candidate.

        Args:
            one: the candidate.
            x: values of the unknowns, (m,) or (m + 1,). The last value of (m + 1,) is
                the change of the shape parameter.

        Returns:
            (R, 6, m) or (R, 6, m + 1) [rad, m] changes per unknown.
        """
        m = len(self.axes(one))
        by = 0.0 if x is None or len(x) == m else float(x[-1])
        # Values of one unknown are stored contiguously for speed.
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
        """Return the screw component of each unknown of a candidate, (m,)."""
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
        """Yield the sensitivity (R, 6) and basis functions (R, q) of each component."""
        for part in one.parts:
            columns, mixed = self.basis(part.variables, one.shape)
            if by:
                columns = self._raw(part.variables, one.shape.bent(by)) @ mixed
            columns = columns[self.rows]
            for component in part.components:
                yield self.sensitivity(part.where, component, one.kind), columns

    def fitted(self, one: Candidate, x: NDArray, std: NDArray) -> list[Function]:
        """Return the functions of a robot file that represent a fitted candidate.

        Args:
            one: the candidate.
            x: values of the unknowns, (m,) or (m + 1,) as in :meth:`changes`.
            std: standard deviations of the unknowns.

        Returns:
            One function for each location that affects the readings. If a variable is
            unknown in some sessions, one function for each session with known values.
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
            shown = []  # screw components that affect the readings
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
        """Return the sessions in which variables are known, or (None,) for all."""
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
    """Return the changes (R, 6) of the readings per unit of a screw component.

    Args:
        where: a frame, ``"base"`` or ``"reading"``.
        component: screw component.
        kind: ``"screw"`` or ``"compliance"``.
        robot: the robot.
        response: changes of the readings per unit screw at the frames.
        origin: (R, 3) [m] position of the platform.
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
    """Return the changes (N, m) of the readings per unknown, divided by sigma."""
    changes = np.moveaxis(sensitivities.changes(one), 2, 0) / campaign.sigma
    columns = changes.reshape(len(changes), -1)
    if not campaign.cells.all():
        columns = columns[:, campaign.cells.ravel()]
    return columns.T
