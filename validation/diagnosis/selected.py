"""What the search of a diagnosis found."""

from dataclasses import dataclass

from numpy.typing import NDArray

from validation.diagnosis.candidates import Candidate, CandidatePart
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.noise import Noise
from validation.diagnosis.states import State


@dataclass(frozen=True, eq=False)
class Learned:
    """A function that was found.

    Attributes:
        candidate: where, of what, in which form.
        equivalent: places and variables that do as well.
        gain: logarithm of how much likelier it makes the readings.
        std: (m,) prior size of its unknowns, as :class:`.Sensitivities` counts them.
        probability: that some function of this variable acts.
    """

    candidate: Candidate
    equivalent: tuple[tuple[CandidatePart, ...], ...]
    gain: float
    std: NDArray
    probability: float


@dataclass(frozen=True, eq=False)
class SmallPrior:
    """Geometry and springs in use.

    Attributes:
        spring: (k,) bool.
        frame, axis: (k,) row of the frame in the campaign's robot, component there.
        std: (k,) [rad, m, or per wrench] prior standard deviation.
    """

    spring: NDArray
    frame: NDArray
    axis: NDArray
    std: NDArray


@dataclass(frozen=True)
class Model:
    """A model by its names.

    Attributes:
        effects: of the library.
        functions: each in words.
        probability: after the readings were looked at.
    """

    effects: tuple[str, ...]
    functions: tuple[str, ...]
    probability: float


@dataclass(frozen=True, eq=False)
class Selected:
    """What a search found.

    Attributes:
        hypotheses: of the best model, the measuring frame first where it is not known.
        values: (k,) of their unknowns, one hypothesis after the other.
        functions: of the best model.
        prior: geometry and springs in use.
        noise: its scale.
        weights: (n,) probability of every cell that it is no blunder.
        models: the likely ones, best first.
        probability: of every effect of the library that some model has.
        unknowns: [-] well determined, the measuring frame's among them.
        blocks: configurations, or spans of time.
        gain: log posterior of the best model over the model without elements.
        states: models that were seen, best first.
    """

    hypotheses: tuple[Hypothesis, ...]
    values: NDArray
    functions: tuple[Learned, ...]
    prior: SmallPrior
    noise: Noise
    weights: NDArray
    models: tuple[Model, ...]
    probability: dict[str, float]
    unknowns: float
    blocks: int
    gain: float
    states: tuple[State, ...]

    @property
    def enough(self) -> bool:
        """Whether there are more blocks of rows than a model needs unknowns."""
        return self.blocks >= self.unknowns + 2
