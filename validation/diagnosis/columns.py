"""Compute the columns of all candidates from the design of a campaign."""

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
_CLOCK = 0.999  # correlation with time above which a variable is taken as the time
# Number of random rows on which functions are scored first.
_SAMPLE = 500
# A candidate counts as imitated by the measuring frame if a smaller fraction of its
# column remains after projecting out the motions of the frame.
_ALIKE = 1e-3
# Smallest visible change: sum of squares of the whitened readings, two standard
# deviations.
_VISIBLE = 4.0


class Columns:
    """Columns of the N measured cells of a campaign.

    Attributes:
        campaign, conditions: campaign of R rows and its conditions.
        row: (N,) row of each cell.
        block: (N,) configuration or time span of each cell.
        visit: (N,) file row of each cell; a file row may contain several points.
        motions: (R, 6, 6) change of the readings by platform motions, see
            :func:`.platform_motions`; None if every file row contains only one point.
        device: hypothesis for the unknown pose of the measuring frame; None if it is
            known.
        flat: (N, f) columns of the measuring frame, separate for each session.
        library: elements of the library effects.
        nuisance: geometric errors and springs, which every machine has.
        functions: candidate functions at single places.
        sampled: (N,) mask of the cells on which functions are scored first.
        explicit: functions at several places, with their columns in the sampled cells.
    """

    def __init__(
        self, campaign: Campaign, derivatives: Derivatives,
        update: Callable[[str, int, int], None] = lambda what, done, total: None,
        odds: Mapping[str, float] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        """Compute the derivatives of the readings by all candidates.

        Readings enter only through the pattern of measured cells.  Conditions include
        the registration and second-order terms.  ``odds`` maps the name of an effect,
        ``"function"``, ``"geometry"`` or ``"springs"`` to a factor on its prior odds; 0
        excludes it.
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
        """Return the hypotheses that change the readings visibly and distinctly."""
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
        """Return the columns without functions and effects of time."""
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
        """Whether there is any candidate effect or function."""
        return bool(self.library or self.explicit or self.functions.variables)

    def loadings(self, cells: NDArray) -> NDArray | None:
        """Return changes (n, 6) of the readings per platform motion, over sigma."""
        if self.motions is None:
            return None
        measured = self.campaign.cells
        over_sigma = self.motions[measured] / self.campaign.sigma[measured][:, None]
        return np.asarray(over_sigma[cells])

    def whitening(
        self, cells: NDArray, root: NDArray, common: tuple[float, float]
    ) -> Whitening:
        """Return the whitening transformation of selected cells (N,).

        ``root`` (n,) contains the square roots of the relative precisions of the cells.
        ``common`` [rad, m] contains the standard deviations of the platform's common
        motion, divided by tau.
        """
        loadings = self.loadings(cells) if any(common) else None
        if loadings is not None:
            loadings = loadings * np.repeat(common, 3)
        return whitening(root, loadings, self.visit[cells])

    @property
    def has_clocks(self) -> bool:
        """Whether rows are ordered in time and time is among the variables."""
        successive = blocks_of(self.campaign)[1] == SPANS
        return successive and any(map(self._is_clock, self.functions.variables))

    def _is_clock(self, name: str) -> bool:
        """Return whether a variable is, or is proportional to, the time."""
        time = self.conditions.time
        if name == "time" or not np.isfinite(time).all() or not np.ptp(time):
            return name == "time"
        x = variable(self.conditions, name)
        return bool(abs(np.corrcoef(x, time)[0, 1]) > _CLOCK)

    def _named(self) -> NDArray:
        """Return the columns (N, c) of library effects with a single unknown."""
        alone = [e.columns for e in self.library if e.columns.shape[1] == 1]
        return np.hstack([np.zeros((len(self.row), 0)), *alone])

    @cached_property
    def flat(self) -> NDArray:
        """(N, f) columns of the measuring frame, separate for each session."""
        if self.device is None:
            return np.zeros((len(self.row), 0))
        columns = self.tangents.at_start(self.device).columns
        sessions = self.campaign.sessions or (None,)
        return np.hstack([columns * self.tangents.rows_of(s) for s in sessions])

    def _told(self, signature: Signature) -> Signature:
        """Project out of a per-session hypothesis what the device pose can imitate."""
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
    """Return a key that identifies hypotheses of one effect with equal columns."""
    shown = signature.columns[:, signature.columns.any(axis=0)]
    starts = tuple(s.start for s in signature.hypothesis.slots if s.shape)
    return signature.hypothesis.effect, tuple(sorted(fingerprints(shown))), starts


def _moves_base(h: Hypothesis) -> bool:
    """Return whether a hypothesis moves the measuring frame, as ``flat`` does."""
    device = LIBRARY[h.effect].device
    return any(name in device for slot in h.slots for name in slot.names)
