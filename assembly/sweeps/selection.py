"""Selection by name of the variables that a sweep computes and stores."""

from collections.abc import Sequence
from dataclasses import replace

from forcefit.assembly.sweeps.quantities import (
    BY_CLEARANCE,
    ERRORS,
    FINITE,
    STRESS,
    Question,
    Variable,
    computed,
)
from forcefit.inputs.errors import BadInput, nearest, quoted

DEFAULT = "default"  # stands for the variables stored if none are named
MODES = 6  # default number of natural frequencies
_STIFFNESS = (
    "compliance", "stiffness", "eigen_stiffness", "stiffness_condition", "share",
)  # fmt: skip
_NEEDED = (
    dict.fromkeys(STRESS, "--yield-strength")
    | dict.fromkeys(ERRORS, "an --assumption")
    | {"wrench": "--wrench-of", "reading": "effects that change what a device reads"}
)  # fmt: skip


def select(question: Question, texts: Sequence[str]) -> Question:
    """Restrict a sweep to named quantities.

    Args:
        question: quantities requested by all other options.
        texts: names of data variables, separated by commas; ``"default"`` stands for
            those stored if none are named.

    Returns:
        The requested quantities, so that no other variables are computed.

    Raises:
        BadInput: a variable is unknown, or an option that it requires is missing.
    """
    every = computed(_with_optional(question))
    kept: list[str] = []
    for name in (part.strip() for text in texts for part in text.split(",")):
        if name == DEFAULT:
            kept += computed(question)
        elif name in every:
            kept.append(name)
        elif name in _NEEDED:
            raise BadInput(f"--quantities: {name} needs {_NEEDED[name]}")
        else:
            hint = nearest(name, [*every, *_NEEDED, DEFAULT])
            raise BadInput(f"--quantities: no {quoted(name)}{hint}")
    return _for(question, {name: every[name] for name in every if name in kept})


def _with_optional(question: Question) -> Question:
    """Return a request for all quantities whose options are set or have defaults."""
    return replace(
        question, clearance_only=True, linearisation=True,
        stiffness=question.stiffness or "nominal",
        frequencies=question.frequencies or MODES,
    )  # fmt: skip


def _for(question: Question, kept: dict[str, Variable]) -> Question:
    """Return a sweep request for exactly the given variables."""
    every = _with_optional(question)
    return replace(
        question,
        kept=tuple(kept),
        assumption=question.assumption if set(ERRORS) & set(kept) else None,
        clearance_only=bool(set(BY_CLEARANCE) & set(kept)),
        linearisation=bool(set(FINITE) & set(kept)),
        stiffness=every.stiffness if set(_STIFFNESS) & set(kept) else "",
        frequencies=every.frequencies if "frequency" in kept else 0,
        wrenches=question.wrenches if "wrench" in kept else (),
        strength=question.strength if set(STRESS) & set(kept) else None,
    )


def quantities_text() -> str:
    """List all variables of sweeps as text: name, unit, meaning, required option."""
    from forcefit.assembly.robots import BUILT_IN

    robot = BUILT_IN["four_bar"]()
    frame = robot.frames[0].name
    question = Question(robot, assumption="frozen", wrenches=(frame,), strength=1.0)
    lines = [
        f"{name:28s}{one.quantity.unit:20s}{one.attributes['long_name']}"
        + (f"; needs {_NEEDED[name]}" if name in _NEEDED else "")
        for name, one in computed(_with_optional(question)).items()
    ]
    return "\n".join(lines)
