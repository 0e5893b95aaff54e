"""Selection of the variables that a sweep computes."""

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

DEFAULT = "default"  # selects the variables that are stored by default
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
    """Select the quantities of a sweep by their names.

    Args:
        question: quantities according to all other options.
        texts: names of variables, separated by commas. ``"default"`` selects the
            variables that are stored if no names are given.

    Returns:
        The selected quantities.

    Raises:
        BadInput: a variable is unknown or requires another option.
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
    """Return all quantities whose options are given or have default values."""
    return replace(
        question, clearance_only=True, linearisation=True,
        stiffness=question.stiffness or "nominal",
        frequencies=question.frequencies or MODES,
    )  # fmt: skip


def _for(question: Question, kept: dict[str, Variable]) -> Question:
    """Return the quantities for the given variables."""
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
    """Return a text with name, unit and description of all variables."""
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
