"""Compute the design matrices of all candidate effects of a campaign."""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.measurement.variables import variable
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.candidates import variables_of
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.elements import Element, effect_element
from forcefit.validation.diagnosis.functions import Functions
from forcefit.validation.diagnosis.holdout import SPANS, blocks_of, drawn
from forcefit.validation.diagnosis.hypotheses import (
    Hypothesis,
    hypotheses,
    sessions_of,
    with_declared,
    with_sessions,
)
from forcefit.validation.diagnosis.joint_functions import joint_functions
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS, nuisance
from forcefit.validation.diagnosis.registration import device_frame
from forcefit.validation.diagnosis.signatures import (
    Signature,
    Tangents,
    fingerprints,
    loaded_components,
)
from forcefit.validation.diagnosis.whitening import (
    Whitening,
    platform_motions,
    whitening,
)

FUNCTION = "function"
_CLOCK = 0.999  # correlation with time above which a variable is treated as time
# Number of random rows on which functions are scored first.
_SAMPLE = 500
# A column of a design matrix is dropped if a smaller fraction of its norm remains after
# motions of the measuring frame are projected out.
_ALIKE = 1e-3
# Smallest visible change, as a sum of squares over the whitened readings.
_VISIBLE = 4.0


class Columns:
    """Design matrices of all candidate effects, for N readings.

    Attributes:
        campaign: campaign of R rows.
        conditions: measuring conditions of the rows.
        row: (N,) row of each reading.
        block: (N,) index of the configuration or time span of each reading.
        visit: (N,) index of the row of the measuring file that contains each reading.
        motions: (R, 6, 6) change of the readings per platform motion, see
            :func:`.platform_motions`. None if every row of the file contains a single
            point.
        device: hypothesis that the pose of the measuring frame is unknown. None if this
            pose is known.
        flat: (N, f) design matrix for the poses of the measuring frame in all sessions.
        library: linear models of the library effects.
        nuisance: design matrix of geometric errors and joint springs.
        functions: candidate functions at single locations.
        sampled: (N,) mask of the readings on which functions are scored first.
        explicit: functions that act at several locations, with their design matrices
            for the sampled readings.
    """

    def __init__(
        self, campaign: Campaign, derivatives: Derivatives,
        update: Callable[[str, int, int], None] = lambda what, done, total: None,
        odds: Mapping[str, float] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        """Compute the derivatives of the readings with respect to all candidates.

        The values of the readings are not used. ``odds`` maps the name of an effect,
        ``"function"``, ``"geometry"`` or ``"springs"`` to a factor on its prior odds. A
        factor of 0 excludes the effect.
        """
        self.odds = odds
        self.campaign, self.conditions = campaign, derivatives.conditions
        self.row = np.nonzero(campaign.cells)[0]
        self.block = blocks_of(campaign)[0][self.row]
        self.visit = campaign.measured_at_once[self.row]
        self.tangents = Tangents(campaign, derivatives)
        unknown = campaign.registration == "unknown"
        self.device: Hypothesis | None = (
            device_frame(self.conditions) if unknown else None
        )
        self.library = self._library(update)
        response = derivatives.response
        self.motions = platform_motions(campaign, response.reading)
        kinds = [k for k in (GEOMETRY, SPRINGS) if odds.get(k, 1.0) > 0.0]
        self.nuisance = nuisance(
            campaign, self.conditions, response, self._named(), kinds
        )
        self.sensitivities = derivatives.sensitivities
        rows = np.unique(self.row)
        rows = rows[drawn(campaign.measured_at_once[rows], _SAMPLE)]
        self.sampled = np.isin(self.row, rows)
        any_function = odds.get(FUNCTION, 1.0) > 0.0
        names = variables_of(self.conditions) if any_function else []
        self.functions = Functions(campaign, self.sensitivities, names)
        self.explicit = joint_functions(self.functions, rows) if any_function else []

    def _library(self, update: Callable[[str, int, int], None]) -> list[Element]:
        """Return library effects that visibly change the readings."""
        campaign = self.campaign
        shown: dict[object, Signature] = {}
        listed = hypotheses(self.conditions, loaded_components(campaign))
        listed = with_declared(listed, campaign.robot)
        listed = with_sessions(listed, campaign.sessions, campaign.per_session)
        listed = [h for h in listed if self.odds.get(h.effect, 1.0) > 0.0]
        for k, h in enumerate(listed):
            if not (self.device and _moves_base(h)):
                signature = self._told(self.tangents.at_start(h))
                if _shows(signature):
                    shown.setdefault(_print(signature), signature)
            update("signatures", k + 1, len(listed))
        ways = Counter(s.hypothesis.effect for s in shown.values())
        prior = {
            name: math.log(self.odds.get(name, 1.0) / (2.0 * len(ways) * count))
            for name, count in ways.items()
        }
        made = [
            effect_element(s, campaign.robot, prior[s.hypothesis.effect])
            for s in shown.values()
        ]
        return [e for e in made if e.columns.shape[1] or e.offset is not None]

    def without_clocks(self) -> "Columns":
        """Return a copy without effects and functions that depend on time."""
        other = copy(self)
        timed = {name for name, effect in LIBRARY.items() if effect.needs == ("time",)}
        other.library = [e for e in self.library if e.name not in timed]
        names = [n for n in self.functions.variables if not self._is_clock(n)]
        other.functions = self.functions.of(names)
        rows = np.unique(self.row[self.sampled])
        other.explicit = joint_functions(other.functions, rows) if names else []
        return other

    @property
    def candidates(self) -> bool:
        """Whether there is at least one candidate effect or function."""
        return bool(self.library or self.explicit or self.functions.variables)

    def loadings(self, cells: NDArray) -> NDArray | None:
        """Return changes (n, 6) of the readings / sigma per platform motion."""
        if self.motions is None:
            return None
        measured = self.campaign.cells
        over_sigma = self.motions[measured] / self.campaign.sigma[measured][:, None]
        return np.asarray(over_sigma[cells])

    def whitening(
        self, cells: NDArray, root: NDArray, common: tuple[float, float]
    ) -> Whitening:
        """Return the whitening transformation of selected readings.

        Args:
            cells: (N,) mask of the n selected readings.
            root: (n,) square roots of the relative precisions.
            common: [rad, m] standard deviations of the common platform motion, divided
                by tau.
        """
        loadings = self.loadings(cells) if any(common) else None
        if loadings is not None:
            loadings = loadings * np.repeat(common, 3)
        return whitening(root, loadings, self.visit[cells])

    @property
    def has_clocks(self) -> bool:
        """Whether held-out blocks are time spans and a function can depend on time."""
        successive = blocks_of(self.campaign)[1] == SPANS
        return successive and any(map(self._is_clock, self.functions.variables))

    def _is_clock(self, name: str) -> bool:
        """Return whether a variable is proportional to time."""
        time = self.conditions.time
        if name == "time" or not np.isfinite(time).all() or not np.ptp(time):
            return name == "time"
        x = variable(self.conditions, name)
        return bool(abs(np.corrcoef(x, time)[0, 1]) > _CLOCK)

    def _named(self) -> NDArray:
        """Return the design matrix (N, c) of library effects with one unknown."""
        alone = [e.columns for e in self.library if e.columns.shape[1] == 1]
        return np.hstack([np.zeros((len(self.row), 0)), *alone])

    @cached_property
    def flat(self) -> NDArray:
        """Design matrix (N, f) for the poses of the measuring frame in all sessions."""
        if self.device is None:
            return np.zeros((len(self.row), 0))
        columns = self.tangents.at_start(self.device).columns
        sessions = self.campaign.sessions or (None,)
        return np.hstack([columns * self.tangents.rows_of(s) for s in sessions])

    def _told(self, signature: Signature) -> Signature:
        """Remove unknowns that are equivalent to a pose of the measuring frame."""
        h = signature.hypothesis
        if not self.flat.shape[1] or sessions_of(h) == (None,):
            return signature
        columns = signature.columns
        size = np.linalg.norm(columns, axis=0)
        there = np.linalg.lstsq(self.flat, columns, rcond=_ALIKE)[0]
        left = np.linalg.norm(columns - self.flat @ there, axis=0)
        kept = np.flatnonzero((left > _ALIKE * size) | (size == 0.0))
        slots = tuple(h.slots[k] for k in kept)
        own = replace(h, slots=slots)
        return replace(signature, hypothesis=own, columns=columns[:, kept])


def _shows(signature: Signature) -> bool:
    """Return whether a hypothesis changes the readings visibly."""
    squares = float(signature.offset @ signature.offset)
    return signature.finite and bool(signature.columns.any() or squares > _VISIBLE)


def _print(signature: Signature) -> object:
    """Return a key that is equal for equivalent hypotheses."""
    shown = signature.columns[:, signature.columns.any(axis=0)]
    starts = tuple(s.start for s in signature.hypothesis.slots if s.shape)
    return signature.hypothesis.effect, tuple(sorted(fingerprints(shown))), starts


def _moves_base(h: Hypothesis) -> bool:
    """Return whether a hypothesis moves the measuring frame."""
    device = LIBRARY[h.effect].device
    return any(name in device for slot in h.slots for name in slot.names)
