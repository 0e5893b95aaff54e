"""Define the result of model selection."""

from dataclasses import dataclass

from numpy.typing import NDArray

from forcefit.validation.diagnosis.candidates import Candidate, CandidatePart
from forcefit.validation.diagnosis.hypotheses import Hypothesis
from forcefit.validation.diagnosis.noise import Noise
from forcefit.validation.diagnosis.range_parts import RangeError
from forcefit.validation.diagnosis.states import State
from forcefit.validation.diagnosis.unknowns import Small


@dataclass(frozen=True, eq=False)
class Learned:
    """A learned function and its probability.

    Attributes:
        candidate: locations, variables and functional form.
        equivalent: other locations and variables with the same predictions.
        std: (m,) prior standard deviations of the unknowns.
        probability: probability that there is a function of these variables.
        range_error: extrapolation error, None if it cannot be estimated.
    """

    candidate: Candidate
    equivalent: tuple[tuple[CandidatePart, ...], ...]
    std: NDArray
    probability: float
    range_error: RangeError | None


@dataclass(frozen=True)
class Model:
    """Effects and functions of a model, and its probability.

    Attributes:
        effects: names of its library effects.
        functions: descriptions of its functions.
        probability: posterior probability.
    """

    effects: tuple[str, ...]
    functions: tuple[str, ...]
    probability: float


@dataclass(frozen=True, eq=False)
class Selected:
    """Result of :func:`.select.select`.

    Attributes:
        hypotheses: effects of the best model, beginning with the pose of an unknown
            measuring frame.
        values: (k,) estimates of the unknowns of the hypotheses.
        functions: functions of the best model.
        small: geometric errors and springs in the best model.
        noise: estimated noise.
        weights: (n,) probability that a reading is not a blunder.
        models: all models, best first.
        probability: probability of each library effect.
        unknowns: [-] number of unknowns that the readings determine.
        states: the visited models, best first.
    """

    hypotheses: tuple[Hypothesis, ...]
    values: NDArray
    functions: tuple[Learned, ...]
    small: tuple[Small, ...]
    noise: Noise
    weights: NDArray
    models: tuple[Model, ...]
    probability: dict[str, float]
    unknowns: float
    states: tuple[State, ...]
