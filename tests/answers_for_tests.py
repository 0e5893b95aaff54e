"""Questions of every kind, and their answers as numbers that can be stored.

    python -m tests.answers_for_tests [NAME ...]    # stores answers anew: all, or these

Stored numbers prove nothing about mechanics; the laws beside them do.  They tell that a
change which was to change nothing changed nothing.  Left out is what rounding decides:
what changes where the inputs are moved by 1e-12, or on an older processor that has no
compiler for C++.
"""

import dataclasses
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import place_robot
from assembly.linear.energy import solve_assembly
from assembly.model.error_distributions import read_sources
from assembly.model.robot import Frame, Robot
from assembly.report.pose_errors import pose_error_of
from assembly.report.results import exact_of, solution_of
from assembly.robots import load_robot
from assembly.statistics.allocated_tolerances import allocation_of
from assembly.statistics.allocation import allocate
from assembly.statistics.clearance_positions import CLEARANCE_MODELS
from assembly.statistics.experiment import Experiment
from assembly.statistics.importance_table import ImportanceOptions
from assembly.statistics.monte_carlo import run_draws
from assembly.statistics.summary import summarise
from assembly.statistics.tolerances import present_errors
from forcefit.native.libraries import by_numba
from stiffness.fem.fea import FemOptions, solve_bar
from stiffness.fem.material import Material
from stiffness.fem.stress import peak_stress, stress_influence
from stiffness.fem.two_ends import two_ends
from stiffness.link import LinkStiffness
from tests.built_in_robots_for_tests import CLOSE, LOAD, WORKSPACE
from tests.further_questions_for_tests import FURTHER
from tests.inner_questions_for_tests import INNER
from tests.part_questions_for_tests import PARTS
from tests.planar_arm_for_tests import measured
from tests.robot_questions_for_tests import ROBOTS
from tests.robots_for_tests import NUMBERS, irsbot2_with
from tests.tolerances_for_tests import plan_for
from validation.campaign.campaign_file import read_campaign
from validation.diagnosis import figures, results
from validation.diagnosis.diagnose import diagnose
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.scene import worst_robot
from validation.diagnosis.text import text
from validation.diagnosis.verdict import calibrate
from validation.synthetic.design import CampaignDesign
from validation.synthetic.generator import generate_campaign, write_campaign

STORED = Path(__file__).with_name("answers.json")
ROOT = Path(__file__).parents[1]  # wherever that is checked out
NUDGE = 1e-12  # relative, of inputs
# differs from one run or machine to the next, or is the size of rounding
LEFT_OUT = (
    "seconds", "version", "sha256", "created", "path", "solver", "residual", "gap",
    "excess", "stationarity", "mismatch", "linearisation_error", "cuts",
    "behind",  # eigenvectors are of either sign, and a rank that numbers decide
)  # fmt: skip
STEADY = 3e-8  # relative change of an answer so moved that is none
SMALLEST = 1e-8  # in SI: what is smaller is compared with it
PRINTED = "--print"  # the answers, instead of storing them
# a processor without wide vectors: sums in other orders
OLDER = {
    "OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "X86_V3",
    "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "PYTHONWARNINGS": "ignore",
}  # fmt: skip
FEW = 6  # numbers that are stored one by one; of more, two sums
LONG = 200  # letters, of which the numbers are stored
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])")

Leaf = str | list[float]


def leaves(answer: Any) -> dict[str, Leaf]:
    """Words and numbers of an answer, gathered by their names; of many two sums."""
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
    """Words and arrays of a tree of objects, under the names that lead to them."""
    if isinstance(value, str):
        to.setdefault(f"{place}:", []).append(value.replace(f"{ROOT}{os.sep}", ""))
    if value is None or isinstance(value, str) or id(value) in above:
        return
    above = above | {id(value)}
    if dataclasses.is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        for name, one in value.items():
            # equal joints of another robot come from a cache with that robot
            cached = name == "robot" and place.endswith("/joints")
            left_out = any(word in str(name) for word in LEFT_OUT)
            if not (cached or left_out):
                # what is named by its number or its frame is gathered
                own = name if str(name).isidentifier() else ""
                _gather(one, f"{place}/{own}", to, above)
        return
    array = None
    if isinstance(value, np.ndarray | np.generic | bool | int | float):
        array = np.asarray(value)
    elif scipy.sparse.issparse(value):
        array = value.tocoo().data
    if array is not None and array.dtype.kind in "bif":
        # how it is shaped counts as well
        shaped = np.r_[array.ravel().astype(float), array.shape]
        to.setdefault(place, []).append(shaped if array.ndim else shaped[:1])
    elif isinstance(value, list | tuple):
        for one in value:
            _gather(one, place, to, above)


def numbers(array: np.ndarray, place: str) -> dict[str, Leaf]:
    """Few numbers as they are; of many their count, the norm and a weighted sum."""
    if len(array) <= FEW:
        return {place: array.tolist()}
    known = np.where(np.isfinite(array), array, 0.0)
    weights = np.cos(1.0 + np.arange(len(array)))
    return {
        f"{place} count": f"{len(array)}, {np.sum(~np.isfinite(array))} unknown",
        f"{place} sums": [float(np.linalg.norm(known)), float(weights @ known)],
    }


def machine(name: str, nudge: float) -> Robot:
    """A built-in robot with errors of its own."""
    robot = load_robot(name)
    rng = np.random.default_rng(sum(map(ord, name)))
    scales = [1e-3, 1e-3, 1e-3, 5e-4, 5e-4, 5e-4]
    errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * scales
    if name == "irsbot2":  # most of its bodies are rigid: nothing would close
        errors[[frame.link is None for frame in robot.frames]] = 0.0
    return robot.with_errors(errors * (1 + nudge))


def linear(name: str, nudge: float) -> Any:
    """Energy, margins and largest pose errors, without a load."""
    posture = place_robot(machine(name, nudge))
    along = [1.0, 0.5, 0.2, 1e-2, -2e-2, 3e-2]
    errors = pose_error_of(posture, point=(0.01, -0.02, 0.03), direction=along, **CLOSE)
    found = {"solve": solution_of(posture), "error": errors}
    solved = solve_assembly(posture)
    exact = solve_exact(posture)
    shown = [one._repr_html_() + repr(one) for one in (solved, exact, posture)]
    return found | {"assembly": solved, "shown": shown}


def loaded(name: str, nudge: float) -> Any:
    """Linear and exact, in the workspace's middle, under a load and gravity."""
    where = {key: (low + 2 * high) / 3 for key, (low, high) in WORKSPACE[name].items()}
    posture = place_robot(machine(name, nudge), where)
    load, gravity = np.array(LOAD) / 4, (0.0, -1.0, -9.81)
    return {
        "error": pose_error_of(posture, load=load, gravity=gravity, **CLOSE),
        "exact": exact_of(posture, load, gravity),
    }


def drawn(clearance_model: str, nudge: float) -> Any:
    """A few draws of the paper's errors."""
    posture = place_robot(load_robot("irsbot2"))
    experiment = Experiment(
        posture, sources_of(nudge), 3, clearance_model, stiffness="contact",
        load=None if clearance_model == "worst" else (0.1, 0, 0, 5, 0, -9),
    )  # fmt: skip
    options = ImportanceOptions(16, "frame") if clearance_model == "least" else None
    data = run_draws(experiment, 3, importance=options)
    limits = {"energy": 5.0, "translation": 1e-3}
    arrays = {
        name: array.values
        for name, array in data.data_vars.items()
        if array.dtype.kind in "bif"
    }
    if clearance_model == "least":
        arrays["summary"] = summarise(data, limits, 2e8, 0.9)
    return arrays


def sources_of(nudge: float) -> Any:
    """Distributions of the paper's errors."""
    path = ROOT / "examples" / "irsbot2_errors.toml"
    sources = read_sources(path, load_robot("irsbot2"))
    return dataclasses.replace(sources, limit=sources.limit * (1 + nudge))


def allocated(limits: dict[str, float], asked: float, nudge: float) -> Any:
    """Tolerances of the paper's robot at two postures, and its present errors."""
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
    """A straight bar by finite elements: K_E, error, mass, stress, both its ends."""
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


def diagnosed(name: str, nudge: float) -> Any:
    """What explains a campaign."""
    campaign = read_campaign(Path(__file__).parent / "campaigns" / name)
    campaign = dataclasses.replace(campaign, measured=campaign.measured * (1 + nudge))
    return told_of(diagnose(campaign))


def planar(nudge: float) -> Any:
    """What is learned of a device somewhere in the room that sags; one odd row."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = measured(
            Path(folder) / "arm", seed=1, missing=0.03, configurations=12, outliers=(7,)
        )
    readings = campaign.measured * (1 + nudge)
    readings[:, 5] -= 1e-6 * np.linalg.norm(campaign.loads[:, 3:], axis=1)
    campaign = dataclasses.replace(campaign, measured=readings, registration="unknown")
    found = diagnose(campaign)
    assert found.foretells
    return told_of(found, simulated=2) | {"corrected": results.corrected(found)}


def inaccurate(nudge: float) -> Any:
    """An arm whose frames are all so far off that finite errors show."""
    turning = {"joint": "revolute", "actuated": True}
    robot = Robot("arm", "tool", (
        Frame("j1", **turning),
        Frame("j2", "j1", [0.1, 0, 0.3], [np.pi / 2, 0, 0.3], **turning),
        Frame("j3", "j2", [0.35, 0.1, 0], [0, np.pi / 3, 0], **turning),
        Frame("tool", "j3", [0.3, 0.05, 0.1]),
    ))  # fmt: skip
    errors = np.random.default_rng(3).normal(size=(4, 6)) * np.repeat([8e-3, 2e-3], 3)
    design = CampaignDesign(configurations=8, rows=20, load=20.0, reach=1.2)
    made = generate_campaign(
        robot.with_errors(errors), {}, design, seed=2, program="springs"
    )
    with tempfile.TemporaryDirectory() as folder:
        write_campaign(dataclasses.replace(made, robot=robot), Path(folder) / "arm")
        campaign = read_campaign(Path(folder) / "arm")
    readings = campaign.measured * (1 + nudge)
    return told_of(diagnose(dataclasses.replace(campaign, measured=readings)))


def told_of(found: Diagnosis, simulated: int = 0) -> Any:
    """A diagnosis, and what pages and tables say and draw of it."""
    told: list[tuple[int, int]] = []
    tally = None
    if simulated:
        tally = calibrate(
            found.screen, found.best, simulated, lambda *words: told.append(words)
        )
    return {
        "found": found,
        "table": results.table(found, tally),
        "text": text(found, tally),
        "told": told,
        "shown": [found._repr_html_(), repr(found)],
        "separability": figures.separability_of(found),
        "charts": {chart.__name__: chart(found) for chart in (
            figures.error_chart, figures.ladder_chart, figures.vector_charts,
            figures.covariate_charts, figures.probability_chart,
            figures.confounding_chart, worst_robot,
        )},
    }  # fmt: skip


QUESTIONS: dict[str, Callable[[float], Any]] = {
    **{f"linear {name}": partial(linear, name) for name in WORKSPACE},
    **{f"loaded {n}": partial(loaded, n) for n in ("irsbot2", "hexapod", "3rrr")},
    **{f"drawn {m}": partial(drawn, m) for m in CLEARANCE_MODELS},
    "tolerances, all": partial(allocated, {"margin_free": 1.0}, 1.0),
    "tolerances, most": partial(allocated, {"energy": 1.0}, 0.9),
    "tube": partial(bar, {"radius": 0.1, "inner_radius": 0.06}, "rigid"),
    **{f"diagnosis {c}": partial(diagnosed, c)
       for c in ("constant_temperature", "stand", "encoder_offset")},
    "inaccurate": inaccurate,
    "planar": planar,
    **PARTS,
    **ROBOTS,
    **FURTHER,
    **INNER,
}  # fmt: skip


def close(was: Leaf | None, now: Leaf | None, relative: float) -> bool:
    """Whether numbers are the same but for rounding, and words the same."""
    if not isinstance(was, list) or not isinstance(now, list) or len(was) != len(now):
        return was == now
    size = max(np.abs(np.array(was)[np.isfinite(was)]).max(initial=0.0), SMALLEST)
    return np.allclose(was, now, rtol=0.0, atol=relative * size, equal_nan=True)


def stored_anew(names: list[str]) -> dict[str, dict[str, Leaf]]:
    """Of each answer the leaves that rounding does not decide."""
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
    """As many digits as are compared, and three more."""
    return [float(f"{x:.9g}") for x in value] if isinstance(value, list) else value


def main() -> None:
    """Store answers."""
    names = [name for name in sys.argv[1:] if name != PRINTED] or [*QUESTIONS]
    if PRINTED in sys.argv:
        with by_numba():
            answers = {name: leaves(QUESTIONS[name](0.0)) for name in names}
        print(json.dumps(answers))
        return
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    stored |= stored_anew(names)
    STORED.write_text(written({
        name: stored[name] for name in QUESTIONS if name in stored
    }))  # fmt: skip


def written(answers: dict[str, dict[str, Leaf]]) -> str:
    """JSON in which changes are seen line by line."""
    parts = []
    for name, answer in answers.items():
        lines = (f"{json.dumps(k)}: {json.dumps(v)}" for k, v in answer.items())
        parts.append(f"{json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    main()
