"""Everything a search may use, of a campaign's design alone: no reading is seen."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY, apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_second_order
from assembly.measurement.variables import variable
from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import Sensitivities
from validation.diagnosis.elements import Element, effect_element, effect_prior
from validation.diagnosis.functions import Functions
from validation.diagnosis.holdout import SPANS, blocks_of
from validation.diagnosis.hypotheses import Hypothesis, hypotheses, with_declared
from validation.diagnosis.nuisance import Nuisance, nuisance
from validation.diagnosis.registration import device_frame
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import (
    Signature,
    Tangents,
    loaded_components,
    whiten,
)
from validation.diagnosis.small_terms import small_terms
from validation.diagnosis.together import together

FUNCTION = "function"
_CLOCK = 0.999  # correlation with time of what counts it
_VISIBLE = 4.0  # squared whitened change of the readings


class Columns:
    """Columns of the N measured cells of a campaign.

    Attributes:
        campaign, conditions: of R rows.
        row: (N,) of every cell.
        block: (N,) its configuration, or span of time.
        device: the measuring frame, where it is not known; else None.
        flat: (N, f) whitened change per unknown of it, session by session.
        library: ways in which the library's effects may act.
        nuisance: geometry and springs.
        functions: what may act beside them.
        explicit: further functions with their columns.
    """

    def __init__(
        self, campaign: Campaign, conditions: Conditions,
        update: Callable[[str, int, int], None] = lambda what, done, total: None,
        odds: Mapping[str, float] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        """Take all derivatives.

        Args:
            campaign: of which ``measured`` says what was measured, and nothing else.
            conditions: of its rows, with the registration if that was found and with
                what finite geometric errors add.
            update: told what is done, how much of it and of how much.
            odds: factors on the prior odds of effects, of ``"function"``, and of
                ``"geometry"`` and ``"springs"``, by name; 0 leaves something out.
        """
        self.odds = odds
        self.campaign, self.conditions = campaign, conditions
        self.row = np.nonzero(campaign.cells)[0]
        self.block = blocks_of(campaign)[0][self.row]
        self.tangents = Tangents(campaign, conditions)
        unknown = campaign.registration == "unknown"
        self.device: Hypothesis | None = device_frame(conditions) if unknown else None
        self.library = self._library(update)
        self.response = responses(conditions)
        terms = small_terms(campaign, conditions, self.response)
        terms = [term for term in terms if odds.get(term.name, 1.0) > 0.0]
        self.nuisance: Nuisance = nuisance(terms, self._named())
        self.sensitivities = Sensitivities(conditions, campaign.robot, self.response)
        any_function = odds.get(FUNCTION, 1.0) > 0.0
        self.functions = Functions(campaign, self.sensitivities, any_function)
        self.explicit = together(self.functions) if any_function else []

    def _library(self, update: Callable[[str, int, int], None]) -> list[Element]:
        """Hypotheses that show; of those that do the same, the first."""
        listed = hypotheses(self.conditions, loaded_components(self.campaign))
        shown: dict[object, Signature] = {}
        listed = with_declared(listed, self.campaign.robot)
        listed = [h for h in listed if self.odds.get(h.effect, 1.0) > 0.0]
        for k, h in enumerate(listed):
            if not (self.device and _moves_base(h)):
                signature = self.tangents.at_start(h)
                if _shows(signature):
                    shown.setdefault(_print(signature), signature)
            update("signatures", k + 1, len(listed))
        ways = Counter(s.hypothesis.effect for s in shown.values())
        robot = self.campaign.robot
        made = [
            effect_element(s, robot, self._prior(s.hypothesis.effect, ways))
            for s in shown.values()
        ]
        return [e for e in made if e.columns.shape[1] or e.offset is not None]

    def _prior(self, effect: str, ways: Counter[str]) -> float:
        """Ln of the prior of one way in which an effect may act."""
        prior = effect_prior(len(ways), ways[effect])
        return prior + math.log(self.odds.get(effect, 1.0))

    def without_clocks(self) -> "Columns":
        """The same without functions of time and effects that time alone drives."""
        other = copy(self)
        timed = {name for name, effect in LIBRARY.items() if effect.needs == ("time",)}
        other.library = [e for e in self.library if e.name not in timed]
        names = [n for n in self.functions.variables if not self._is_clock(n)]
        other.functions = self.functions.of(names)
        other.explicit = together(other.functions) if names else []
        return other

    @property
    def has_clocks(self) -> bool:
        """Whether rows follow one another and something counts the time."""
        successive = blocks_of(self.campaign)[1] == SPANS
        return successive and any(map(self._is_clock, self.functions.variables))

    def _is_clock(self, name: str) -> bool:
        """Whether a variable goes with time alone."""
        time = self.conditions.time
        if name == "time" or not np.isfinite(time).all() or not np.ptp(time):
            return name == "time"
        x = variable(self.conditions, name)
        return bool(abs(np.corrcoef(x, time)[0, 1]) > _CLOCK)

    def _named(self) -> NDArray:
        """(N, c) columns of single unknowns of springs that have a name."""
        alone = [e.columns for e in self.library if e.columns.shape[1] == 1]
        return np.hstack([np.zeros((len(self.row), 0)), *alone])

    @cached_property
    def flat(self) -> NDArray:
        """(N, f) the measuring frame's columns, each session's by themselves."""
        if self.device is None:
            return np.zeros((len(self.row), 0))
        columns = self.tangents.at_start(self.device).columns
        if self.campaign.session is None:
            return columns
        own = [
            columns * (self.campaign.session[self.row] == name)[:, None]
            for name in self.campaign.sessions
        ]
        return np.hstack(own)

    def again(
        self, elements: Sequence[Element], xs: Sequence[NDArray]
    ) -> list[Element]:
        """Effects to first order about values that they have together.

        Args:
            elements: of the library.
            xs: values of the slots of each.

        Returns:
            Elements whose sum, at these values, is what all of them do; those given
            where the model has no answer.
        """
        robot = self.campaign.robot
        public = self._public(elements, xs)
        middle = self.together(elements, xs)
        made = []
        for e, x in zip(elements, xs, strict=True):
            others = {name: v for name, v in public.items() if name != e.name}
            signature = self.tangents.about(e.hypothesis, x, others)
            if not _finite(signature) or not np.isfinite(middle).all():
                return list(elements)
            middle = middle - signature.columns @ x
            made.append(replace(signature, offset=np.zeros_like(middle)))
        # what all of them do together beside their tangents goes with the first
        made[0] = replace(made[0], offset=middle)
        return [
            replace(effect_element(s, robot, e.log_prior, x), first=e.origin)
            for s, e, x in zip(made, elements, xs, strict=True)
        ]

    def together(self, elements: Sequence[Element], xs: Sequence[NDArray]) -> NDArray:
        """(N,) what effects of the library do together, whitened."""
        public = self._public(elements, xs)
        if any(LIBRARY[name].clearance for name in public):
            return self.tangents.model(public) - self.tangents.declared
        changed = apply_effects(self.conditions, public)
        if np.ndim(self.conditions.second_order) == 2:
            # what they move is finite, as the declared errors are
            changed = with_second_order(changed)
        whitened = whiten(self.campaign, predict(changed).deviation)
        return whitened - self.tangents.declared

    def _public(
        self, elements: Sequence[Element], xs: Sequence[NDArray]
    ) -> dict[str, dict[str, float]]:
        """Parameters of effects by their public names."""
        robot = self.conditions.robot
        return {
            e.name: e.hypothesis.public(robot, x)
            for e, x in zip(elements, xs, strict=True)
        }


def _finite(signature: Signature) -> bool:
    """Whether the model had answers for a hypothesis."""
    return bool(
        np.isfinite(signature.columns).all() and np.isfinite(signature.offset).all()
    )


def _shows(signature: Signature) -> bool:
    """Whether a hypothesis changes the readings; enough, without unknowns."""
    if not _finite(signature):
        return False
    squares = float(signature.offset @ signature.offset)
    return bool(signature.columns.any()) or squares > _VISIBLE


def _print(signature: Signature) -> object:
    """By which equal ways of one effect are known."""
    rng = np.random.default_rng(0)
    probe = rng.normal(size=len(signature.offset))
    size = np.maximum(np.linalg.norm(signature.columns, axis=0), 1e-300)
    seen = np.abs(probe @ signature.columns) / size
    shown = signature.columns.any(axis=0)
    key = tuple(np.round(np.sort(seen[shown]), 6))
    starts = tuple(s.start for s in signature.hypothesis.slots if s.shape)
    return signature.hypothesis.effect, key, starts


def _moves_base(h: Hypothesis) -> bool:
    """Whether a hypothesis moves the measuring frame, which is fitted anyway."""
    device = LIBRARY[h.effect].device
    return any(name in device for slot in h.slots for name in slot.names)
