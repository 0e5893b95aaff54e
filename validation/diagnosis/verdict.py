"""Determine the verdict of a diagnosis from model probabilities."""

from forcefit.assembly.model.statuses import (
    AMBIGUOUS,
    EXPLAINED,
    LEARNED,
    NONE_NEEDED,
    OUTSIDE_LIBRARY,
)
from forcefit.validation.diagnosis.columns import FUNCTION
from forcefit.validation.diagnosis.selected import Selected

CLAIM = 0.9  # probability above which an effect is claimed
RIVAL = 0.5  # probability above which an effect that is not claimed is a rival effect
_LISTED = 0.02  # probability above which an alternative set of effects is listed

Sets = tuple[tuple[tuple[str, ...], float], ...]


def by_names(selected: Selected) -> Sets:
    """Return the probabilities of sets of effects, most probable first.

    Returns:
        The effect names and the probability of each set.  For a model with functions,
        ``"function"`` is added to the names.
    """
    weights: dict[tuple[str, ...], float] = {}
    for model in selected.models:
        names = (*model.effects, *(FUNCTION for _ in model.functions[:1]))
        weights[names] = weights.get(names, 0.0) + model.probability
    listed = sorted(weights.items(), key=lambda item: -item[1])
    return tuple((names, p) for names, p in listed if p >= _LISTED)


def verdict(
    selected: Selected, names: tuple[str, ...], *, functions: bool, small: bool,
    more_than_noise: bool,
) -> tuple[str, tuple[str, ...]]:  # fmt: skip
    """Return the verdict and the claimed effects.

    Args:
        selected: models with their probabilities.
        names: names of the library effects of the fitted machine.
        functions: whether the model contains functions.
        small: whether the model contains geometric errors or joint springs.
        more_than_noise: whether the residual of the model exceeds the noise.

    Returns:
        ``"none_needed"``, ``"explained"``, ``"learned"``, ``"ambiguous"`` or
        ``"outside_library"``, and the names of the claimed effects.
    """
    if more_than_noise:
        return OUTSIDE_LIBRARY, ()
    likely = sum(m.probability for m in selected.models if m.functions)
    sure = tuple(n for n in names if selected.probability.get(n, 0.0) >= CLAIM)
    rivals = [
        name for name, p in selected.probability.items()
        if RIVAL <= p < CLAIM or (p >= CLAIM and name not in names)
    ]  # fmt: skip
    decided = set(sure) == set(names) and not rivals
    if functions:
        return (LEARNED, sure) if decided and likely >= CLAIM else (AMBIGUOUS, ())
    if names:
        return (EXPLAINED, sure) if decided else (AMBIGUOUS, ())
    nothing = sum(
        m.probability for m in selected.models if not m.effects and not m.functions
    )
    if likely >= RIVAL or (nothing < RIVAL and rivals):
        return AMBIGUOUS, ()
    return (EXPLAINED if small else NONE_NEEDED), ()
