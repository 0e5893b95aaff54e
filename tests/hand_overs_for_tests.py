"""What one file hands to another while a question is answered, as numbers.

    python -m tests.hand_overs_for_tests [NAME ...]  # stores them anew: all, or these

An answer hides what is made good on the way to it: a Newton step that is wrong takes
more steps, a threshold that is off refines a mesh that was fine, and what comes out is
the same.  So for the questions of ``answers_for_tests.py`` the first results of every
function that another file calls are kept as well, and how often it was called.  What a
file does within itself may change freely.  As of answers, what rounding decides is left
out, and what is meant to change is stored anew.
"""

import dataclasses
import json
import os
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from assembly.solvers.native import by_numba
from tests.answers_for_tests import (
    NUDGE,
    OLDER,
    PRINTED,
    QUESTIONS,
    ROOT,
    STEADY,
    Leaf,
    close,
    leaves,
    rounded,
    written,
)

STORED = Path(__file__).with_name("hand_overs.json")
CHAPTERS = ("stiffness", "assembly", "validation")
# what is seen on pages, and what compiles loops once
LEFT_OUT = {"report.py", "plot.py", "compiled.py", "native.py"}
# wide vectors, but fewer than the newest
OTHER = {"OPENBLAS_CORETYPE": "Haswell", "NUMBA_CPU_NAME": "haswell"}
FIRST = 2  # results of a function that are kept
OFTEN = 3  # questions whose results of one function are kept
DEEP = 2  # names that lead to a number within a result
MANY = 20  # of a list that are kept


class Recorder:
    """A profiler that keeps what functions of our files return to other files."""

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()
        self.results: dict[str, dict[str, Leaf]] = defaultdict(dict)
        self.names: dict[CodeType, str] = {}

    def __call__(self, frame: FrameType, event: str, result: Any) -> None:
        """Keep a result; other events are none of ours."""
        if event != "return":
            return
        code, caller = frame.f_code, frame.f_back
        name = self.names.get(code)
        if name is None:
            name = self.names[code] = name_of(code)
        if not name or caller is None:
            return
        if caller.f_code.co_filename == code.co_filename:
            return
        sys.setprofile(None)
        self.calls[name] += 1
        if self.calls[name] <= FIRST:
            for place, leaf in leaves(shallow(result)).items():
                self.results[name][f"{place} {self.calls[name]}"] = leaf
        sys.setprofile(self)

    def leaves(self) -> dict[str, Leaf]:
        """By function and by name within its result."""
        found: dict[str, Leaf] = {}
        for name, calls in self.calls.items():
            found[name] = [float(calls)]
            found |= {f"{name} {p}": leaf for p, leaf in self.results[name].items()}
        return found


def shallow(value: Any, deep: int = DEEP) -> Any:
    """A result without what it is made from: robots, postures, campaigns."""
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return [shallow(one, deep) for one in value[:MANY]]
    if dataclasses.is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    elif isinstance(value, tuple):
        value = value._asdict()
    if isinstance(value, Mapping):
        some = list(value.items())[:MANY] if deep else []
        return {name: shallow(one, deep - 1) for name, one in some}
    return value


def name_of(code: CodeType) -> str:
    """Module and name of a function of a numerical chapter; empty of any other."""
    path = Path(code.co_filename)
    if not path.is_relative_to(ROOT) or path.name in LEFT_OUT:
        return ""
    parts = path.relative_to(ROOT).with_suffix("").parts
    dunder = code.co_name.startswith("__") and code.co_name != "__call__"
    if (
        parts[0] not in CHAPTERS
        or "report" in parts
        or dunder
        or code.co_name[0] == "<"
    ):
        return ""
    return ".".join((*parts, code.co_qualname))


def hand_overs(question: Callable[[float], Any], nudge: float) -> dict[str, Leaf]:
    """What is handed over while a question is answered."""
    for module in list(sys.modules.values()):
        name = getattr(module, "__name__", "")
        if name.startswith(CHAPTERS) and not name.startswith("assembly.solvers"):
            for value in list(vars(module).values()):
                # what another test has put there would not be asked for again
                if callable(clear := getattr(value, "cache_clear", None)):
                    clear()
    recorder = Recorder()
    sys.setprofile(recorder)
    try:
        question(nudge)
    finally:
        sys.setprofile(None)
    return recorder.leaves()


def stored_anew(names: list[str]) -> dict[str, dict[str, Leaf]]:
    """Of each question the leaves that rounding does not decide."""
    words = [sys.executable, "-m", "tests.hand_overs_for_tests", PRINTED, *names]
    elsewhere = [
        json.loads(
            subprocess.run(
                words, env=os.environ | processor, stdout=subprocess.PIPE, check=True
            ).stdout
        )
        for processor in (OLDER, OTHER)
    ]
    stored: dict[str, dict[str, Leaf]] = {}
    often: Counter[str] = Counter()
    for name in names:
        one, again, moved = (
            hand_overs(QUESTIONS[name], nudge) for nudge in (0.0, 0.0, NUDGE)
        )
        rarely = {function for function in often if often[function] < OFTEN}
        rarely |= {place for place in one if " " not in place} - often.keys()
        often.update(place for place in one if " " not in place)
        stored[name] = {
            place: rounded(value)
            for place, value in one.items()
            if place.partition(" ")[0] in rarely
            and all(
                close(value, other.get(place), STEADY)
                for other in (again, moved, *(found[name] for found in elsewhere))
            )
        }
    return stored


def main() -> None:
    """Store what is handed over."""
    # those of few calls first: they show best what a function does
    names = [name for name in sys.argv[1:] if name != PRINTED] or [*reversed(QUESTIONS)]
    if PRINTED in sys.argv:
        with by_numba():
            found = {name: hand_overs(QUESTIONS[name], 0.0) for name in names}
        print(json.dumps(found))
        return
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    stored |= stored_anew(names)
    STORED.write_text(
        written({name: stored[name] for name in QUESTIONS if stored.get(name)})
    )


if __name__ == "__main__":
    main()
