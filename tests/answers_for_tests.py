"""Regression tests: compute results of many functions and store them as numbers.

    python -m tests.answers_for_tests [NAME ...]    # stores all results, or the named

The stored numbers show whether a refactoring has changed a result.  Numbers that depend
on rounding are not stored: those that change if the inputs change by 1e-12, or if the
processor has no wide vector instructions.
"""

import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.error_distributions import read_sources
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.report.results import exact_of, solution_of
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.allocated_tolerances import allocation_of
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_table import ImportanceOptions
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.summary import summarise
from forcefit.assembly.statistics.tolerances import present_errors
from forcefit.stiffness.fem.fea import FemOptions, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.stress import peak_stress, stress_influence
from forcefit.stiffness.fem.two_ends import two_ends
from forcefit.stiffness.link import LinkStiffness
from tests.beam_questions_for_tests import BEAMS
from tests.built_in_robots_for_tests import CLOSE, LOAD, WORKSPACE
from tests.effect_questions_for_tests import EFFECTS
from tests.further_questions_for_tests import FURTHER
from tests.robot_questions_for_tests import ROBOTS
from tests.robots_for_tests import NUMBERS, irsbot2_with
from tests.tolerances_for_tests import plan_for

STORED = Path(__file__).with_name("answers.json")
ROOT = Path(__file__).parents[1]  # root folder of the repository
NUDGE = 1e-12  # relative change of the inputs
# names of values that depend on the run or on the machine, or are rounding errors
LEFT_OUT = (
    "seconds", "version", "sha256", "created", "path", "solver", "residual", "gap",
    "excess", "stationarity", "mismatch", "linearisation_error", "cuts",
    "behind",  # eigenvectors of arbitrary sign, with a rank that rounding can change
)  # fmt: skip
# fields of results that contain inputs or intermediate results
NO_ANSWERS = {"robot", "linearisation", "joints", "plan", "sources"}
STEADY = 3e-8  # largest relative change attributed to rounding
SMALLEST = 1e-8  # [SI units] smallest scale for relative changes
PRINTED = "--print"  # print the results instead of storing them
# environment that emulates a processor without wide vector instructions
OLDER = {
    "OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "X86_V3",
    "PYTHONWARNINGS": "ignore",
}  # fmt: skip
FEW = 6  # largest array whose numbers are stored individually
LONG = 200  # [characters] only the numbers in longer texts are stored
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])")

Leaf = str | list[float]


def leaves(answer: Any) -> dict[str, Leaf]:
    """Return the texts and numbers in a result by name; long arrays are reduced."""
    gathered: dict[str, list[Any]] = {}
    _gather(answer, "", gathered, set())
    found: dict[str, Leaf] = {}
    for place, values in gathered.items():
        if any(isinstance(value, str) for value in values):
            whole = " ".join(map(str, values))
            if len(whole) < LONG:
                found[place] = whole
            else:
                found |= numbers(np.array(NUMBER.findall(whole), dtype=float), place)
        else:
            found |= numbers(np.concatenate(values), place)
    return found


def _gather(value: Any, place: str, to: dict[str, list], above: set[int]) -> None:
    """Collect the texts and arrays in nested objects by their path."""
    if isinstance(value, str):
        to.setdefault(f"{place}:", []).append(value.replace(f"{ROOT}{os.sep}", ""))
    if value is None or isinstance(value, str) or id(value) in above:
        return
    above = above | {id(value)}
    left_out: set[str] = set()
    if dataclasses.is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        left_out = NO_ANSWERS
    if isinstance(value, Mapping):
        for name, one in value.items():
            passing = any(word in str(name) for word in LEFT_OUT)
            if name not in left_out and not passing:
                # values whose keys are numbers or frame names share one path
                own = name if str(name).isidentifier() else ""
                _gather(one, f"{place}/{own}", to, above)
        return
    array = None
    if isinstance(value, np.ndarray | np.generic | bool | int | float):
        array = np.asarray(value)
    elif scipy.sparse.issparse(value):
        array = value.tocoo().data
    if array is not None and array.dtype.kind in "bif":
        # the shape is stored as well
        shaped = np.r_[array.ravel().astype(float), array.shape]
        to.setdefault(place, []).append(shaped if array.ndim else shaped[:1])
    elif isinstance(value, list | tuple):
        for one in value:
            _gather(one, place, to, above)


def numbers(array: np.ndarray, place: str) -> dict[str, Leaf]:
    """Return a short array, or the length, norm and weighted sum of a long one."""
    if len(array) <= FEW:
        return {place: array.tolist()}
    known = np.where(np.isfinite(array), array, 0.0)
    weights = np.cos(1.0 + np.arange(len(array)))
    return {
        f"{place} count": f"{len(array)}, {np.sum(~np.isfinite(array))} unknown",
        f"{place} sums": [float(np.linalg.norm(known)), float(weights @ known)],
    }


def machine(name: str, nudge: float) -> Robot:
    """Return a built-in robot with random geometric errors."""
    robot = load_robot(name)
    rng = np.random.default_rng(sum(map(ord, name)))
    scales = [1e-3, 1e-3, 1e-3, 5e-4, 5e-4, 5e-4]
    errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * scales
    if name == "irsbot2":  # errors of rigid bodies would prevent assembly
        errors[[frame.link is None for frame in robot.frames]] = 0.0
    return robot.with_errors(errors * (1 + nudge))


def linear(name: str, nudge: float) -> Any:
    """Compute energy, margins and largest pose errors without a load."""
    posture = place_robot(machine(name, nudge))
    along = [1.0, 0.5, 0.2, 1e-2, -2e-2, 3e-2]
    errors = pose_error_of(posture, point=(0.01, -0.02, 0.03), direction=along, **CLOSE)
    found = {"solve": solution_of(posture), "error": errors}
    solved = solve_assembly(posture)
    exact = solve_exact(posture)
    shown = [one._repr_html_() + repr(one) for one in (solved, exact, posture)]
    return found | {"assembly": solved, "shown": shown}


def loaded(name: str, nudge: float) -> Any:
    """Compute linear and exact results under a load and gravity."""
    where = {key: (low + 2 * high) / 3 for key, (low, high) in WORKSPACE[name].items()}
    posture = place_robot(machine(name, nudge), where)
    load, gravity = np.array(LOAD) / 4, (0.0, -1.0, -9.81)
    return {
        "error": pose_error_of(posture, load=load, gravity=gravity, **CLOSE),
        "exact": exact_of(posture, load, gravity),
    }


def drawn(clearance: str, nudge: float) -> Any:
    """Compute results for a few random draws of the errors of IRSBot-2."""
    posture = place_robot(load_robot("irsbot2"))
    experiment = Experiment(
        posture, sources_of(nudge), 3, clearance, stiffness="contact",
        load=None if clearance == "worst" else (0.1, 0, 0, 5, 0, -9),
    )  # fmt: skip
    options = ImportanceOptions(16, "frame") if clearance == "least" else None
    data = run_draws(experiment, 3, importance=options)
    limits = {"energy": 5.0, "translation": 1e-3}
    arrays = {
        name: array.values
        for name, array in data.data_vars.items()
        if array.dtype.kind in "bif"
    }
    if clearance == "least":
        arrays["summary"] = summarise(data, limits, 2e8, 0.9)
    return arrays


def sources_of(nudge: float) -> Any:
    """Return the error distributions of IRSBot-2."""
    path = ROOT / "examples" / "irsbot2_errors.toml"
    sources = read_sources(path, load_robot("irsbot2"))
    return dataclasses.replace(sources, limit=sources.limit * (1 + nudge))


def allocated(limits: dict[str, float], asked: float, nudge: float) -> Any:
    """Allocate tolerances of IRSBot-2 at two postures; assess its declared errors."""
    robot = irsbot2_with(NUMBERS["cases"][0], 0.2 * (1 + nudge))
    postures = [place_robot(robot, {"tx": x, "tz": -0.5}) for x in (0.0, 0.1)]
    frames = [f.name for f in robot.frames if f.link is not None][:2]
    places = [(frame, c) for frame in frames for c in (0, 4, 3)]
    plan = plan_for(
        robot, places, [1, 2, 1, 1, 3, 1], limits, asked_yield=asked, draws=40
    )
    found = allocate(postures, plan, fresh=100)
    return {"found": allocation_of(found), "present": present_errors(postures, "free")}


def bar(section: dict[str, float], interface: str, nudge: float) -> Any:
    """Compute stiffness, mass and stress of a straight bar by finite elements."""
    material = Material(7e10, 0.33, density=2700.0)
    options = FemOptions(accuracy=0.5, interface=interface)
    sizes = {name: size * (1 + nudge) for name, size in section.items()}
    solved = solve_bar(sizes, material, options)
    wrench = [3.0, -2.0, 1.0, 200.0, -100.0, 300.0]
    link: LinkStiffness = solved.link
    return {
        "link": link,
        "stress": peak_stress(solved, wrench),
        "influence": stress_influence(solved),
        "ends": two_ends(solved) if interface == "rigid" else None,
    }


QUESTIONS: dict[str, Callable[[float], Any]] = {
    **{f"linear {name}": partial(linear, name) for name in WORKSPACE},
    **{f"loaded {n}": partial(loaded, n) for n in ("irsbot2", "hexapod", "3rrr")},
    **{f"drawn {m}": partial(drawn, m) for m in CLEARANCE_MODELS},
    "tolerances, all": partial(allocated, {"margin_free": 1.0}, 1.0),
    "tolerances, most": partial(allocated, {"energy": 1.0}, 0.9),
    "tube": partial(bar, {"radius": 0.1, "inner_radius": 0.06}, "rigid"),
    **BEAMS,
    **EFFECTS,
    **ROBOTS,
    **FURTHER,
}  # fmt: skip


def close(was: Leaf | None, now: Leaf | None, relative: float) -> bool:
    """Return whether texts are equal and numbers equal up to rounding."""
    if not isinstance(was, list) or not isinstance(now, list) or len(was) != len(now):
        return was == now
    size = max(np.abs(np.array(was)[np.isfinite(was)]).max(initial=0.0), SMALLEST)
    return np.allclose(was, now, rtol=0.0, atol=relative * size, equal_nan=True)


def stored_anew(names: list[str]) -> dict[str, dict[str, Leaf]]:
    """Return the values of each result that do not depend on rounding."""
    words = [sys.executable, "-m", "tests.answers_for_tests", PRINTED, *names]
    older = subprocess.run(
        words, env=os.environ | OLDER, stdout=subprocess.PIPE, check=True
    )
    elsewhere = json.loads(older.stdout)
    answers = {}
    for name in names:
        one, moved = (leaves(QUESTIONS[name](nudge)) for nudge in (0.0, NUDGE))
        answers[name] = {
            place: rounded(value)
            for place, value in one.items()
            if close(value, moved.get(place), STEADY)
            and close(value, elsewhere[name].get(place), STEADY)
        }
    return answers


def rounded(value: Leaf) -> Leaf:
    """Round numbers to 9 significant digits, three more than are compared."""
    return [float(f"{x:.9g}") for x in value] if isinstance(value, list) else value


def main() -> None:
    """Compute and store results."""
    names = [name for name in sys.argv[1:] if name != PRINTED] or [*QUESTIONS]
    if PRINTED in sys.argv:
        answers = {name: leaves(QUESTIONS[name](0.0)) for name in names}
        print(json.dumps(answers))
        return
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    stored |= stored_anew(names)
    STORED.write_text(written({
        name: stored[name] for name in QUESTIONS if name in stored
    }))  # fmt: skip


def written(answers: dict[str, dict[str, Leaf]]) -> str:
    """Format results as JSON with one value per line, for readable diffs."""
    parts = []
    for name, answer in answers.items():
        lines = (f"{json.dumps(k)}: {json.dumps(v)}" for k, v in answer.items())
        parts.append(f"{json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    main()
