"""Questions about what searches work out on the way, for ``answers_for_tests.py``:
steps of the exact equilibrium, scores of sets of effects, what small unknowns leave of
the readings, candidates to be learned, doubts about a campaign."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from assembly.effects import LIBRARY
from assembly.effects.effect import Unknown
from assembly.effects.units import units_of
from assembly.exact.dead_load import dead_loads
from assembly.exact.descent import advance, expand, potential
from assembly.exact.equilibrium import (
    active_clearances,
    curvature_modes,
    imbalance,
    least_curvature,
    tangent_space,
)
from assembly.exact.finite_robot import FiniteRobot
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.linear.closure import virtual_joints
from assembly.model.function import Function
from assembly.robots import load_robot
from assembly.solvers.conic import into_cones
from tests.part_questions_for_tests import rows
from tests.robots_for_tests import random_robot
from validation.campaign.campaign_file import read_campaign
from validation.diagnosis.background import NOTHING, background
from validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    Sensitivities,
    places_of,
    variables_of,
)
from validation.diagnosis.evidence import Prior
from validation.diagnosis.forms_tried import all_shapes, first_shapes
from validation.diagnosis.holdout import blocks_of, split
from validation.diagnosis.hypotheses import Hypothesis, Slot, hypotheses
from validation.diagnosis.lack_of_fit import believed_noise, lack_of_fit, outlying
from validation.diagnosis.learned_range import beyond, learned_range
from validation.diagnosis.plausible import implausible, impossible_rows
from validation.diagnosis.responses import responses
from validation.diagnosis.scoring import Screen, inclusion, posterior
from validation.diagnosis.separability import compare_signatures
from validation.diagnosis.signatures import (
    Signature,
    Tangents,
    conditions_of,
    loaded_components,
    whiten,
)
from validation.diagnosis.small_terms import added, screws_of, small_terms
from validation.diagnosis.verdict import by_names, verdict

CAMPAIGNS = Path(__file__).parent / "campaigns"
FAINT, PLAIN, ABSURD = 1e-3, 0.7, 60.0  # of an unknown's plausible size
# parameters of one form each, their units unlike one another
NUMBERS: dict[str, tuple[str, ...]] = {
    "powers": ("0", "1", "3"), "waves": ("2.sine", "2.cosine", "period"),
    "spline": ("first", "last", "1", "2"), "reversal": ("0", "1"),
    "step": ("at", "size"), "slow_wave": ("period", "sine", "cosine"),
    "lag": ("gain", "start", "time_constant"),
    "creep": ("gain", "start", "time_constant"),
}  # fmt: skip


def digest(value: Any) -> str:
    """Words too long to be stored, as a word that changes with them."""
    return "digest " + sha256(str(value).encode()).hexdigest()


def steps(seed: int, nudge: float) -> Any:
    """A random robot's exact problem, expanded on the way, and steps from there."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 2 + seed % 2, 3)
    posture = home_posture(robot.with_errors(1e-2 * robot.errors * (1 + nudge)))
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    load, gravity = np.array([0.2, -0.1, 0.3, 4.0, -3.0, 5.0]), (0.5, 0.0, -9.81)
    loads = dead_loads(posture, load, gravity=gravity, point=(0.02, 0.0, -0.01))
    x = 1e-2 * rng.uniform(-1, 1, len(model.units)) * model.units
    x[model.bounded] = into_cones(
        rng.uniform(-1.5, 1.5, len(x[model.bounded])), model.joints.group
    )
    found, damping = [], 0.0
    at, rigid = place(model, x), None
    for near in (False, False, True, True):
        local = expand(
            at, loads, np.zeros(len(at.residual)) if rigid is None else rigid
        )
        D, H = tangent_space(local)
        held = tangent_space(local, hold_touching=True)[1]
        step = advance(local, 2 * np.linalg.norm(local.multipliers) + 1, damping, near)
        found.append({
            "residuum": at.residual, "potential": potential(at, loads),
            "gradient": local.gradient, "hessian": local.hessian,
            "multipliers": local.multipliers, "small": local.small_energy,
            "imbalance": imbalance(local), "least": least_curvature(local),
            "curvatures": curvature_modes(D, H, model.units)[0], "kept": held.shape,
            "active": active_clearances(local), "gain": step.gain,
            "decrement": step.decrement, "length": step.length,
            "damping": step.damping, "x": step.placement.x,
        })  # fmt: skip
        at, rigid, damping = step.placement, step.rigid, step.damping
    return found


def made_up(nudge: float) -> list[Signature]:
    """Signatures of five effects in seven ways; two that overlap, one with bounds."""
    rng, found = np.random.default_rng(11), []
    for k, effect in enumerate("aabcdde"):
        columns = rng.normal(size=(40, 1 + k % 3)) * (1 + nudge)
        if k in {2, 5}:
            columns[:, 0] = found[0].columns[:, 0] + 0.02 * columns[:, 0]
        low = 0.0 if effect == "c" else -np.inf
        slots = tuple(
            Slot((f"{effect}{j}",), Unknown(f"x{j}", 1.0, low, np.inf), 0.0)
            for j in range(columns.shape[1])
        )
        where = tuple("pqr"[: 1 + k % 2])
        offset = 0.1 * rng.normal(size=40) * (effect == "b")
        found.append(Signature(Hypothesis(effect, where, slots), offset, columns))
    return found


def scored(nudge: float) -> Any:
    """Sets of made-up effects scored, and what is said of them."""
    signatures = made_up(nudge)
    rng, found = np.random.default_rng(12), []
    for true in ((), (0,), (2, 3), (1, 4), (5, 6)):
        z = rng.normal(size=40)
        for i in true:
            z = z + signatures[i].columns @ rng.uniform(0.5, 1.5, 3)[: 1 + i % 3]
        screen = Screen(z, signatures)
        sets = screen.search()
        other = screen.with_residual(-z)
        found.append({
            "sets": [[one.members, one.score, one.rank] for one in sets[:30]],
            "shown": [screen.shown(one) for one in sets[:5]],
            "posterior": posterior(sets)[:10], "inclusion": inclusion(screen, sets),
            "other": [one.score for one in other.search()[:10]],
            "rescored": screen.rescored(sets[0], 3.0, sets[0].values).score,
            "names": by_names(screen, sets)[:10], "verdict": [
                str(verdict(by_names(screen, sets), inclusion(screen, sets), more))
                for more in (False, True)
            ],
        })  # fmt: skip
    columns = {s.hypothesis.effect: s.columns for s in signatures}
    angles = compare_signatures(columns | {"f": 1e-5 * columns["a"]})
    return {"found": found, "angles": angles, "said": [
        str(angles.classes()), str(angles.imitated()), str(angles.overlapping()),
        angles.visible, angles.traced, angles.shows_at,
    ]}  # fmt: skip


def small(name: str, nudge: float) -> Any:
    """Small unknowns of a campaign's robot, and what they leave of its readings."""
    campaign, conditions = rows(name, nudge)
    response = responses(conditions)
    terms = small_terms(campaign, conditions, response)
    z = whiten(campaign, campaign.measured)
    sizes = {"geometry": (1e-4, 2e-4), "springs": (1e-6, 3e-8)}
    found = {"terms": [[t.name, t.frame, t.axis, t.most, t.group] for t in terms]}
    some = tuple(np.arange(len(term)) % 3 > 0 for term in terms)
    for key, used in (
        ("all", tuple(np.ones(len(term), dtype=bool) for term in terms)), ("some", some)
    ):  # fmt: skip
        behind = background(terms, Prior(used, sizes, -3.0, 0.0))
        values = behind.values(behind.whitened(z))
        found[key] = [
            behind.unknowns, behind.whitened(z), behind.raw(z), values,
            behind.deviations(), behind.identified(), behind.lost(z, values),
            added(campaign, response, conditions, behind.terms, values),
            screws_of(campaign, behind.terms, values),
        ]  # fmt: skip
    return found


def candidates(name: str, nudge: float) -> Any:
    """What may be learned of a campaign: variables, places, forms and their columns."""
    campaign, conditions = rows(name, nudge, 16)
    sensitivities = Sensitivities(conditions, campaign.robot, responses(conditions))
    varied = variables_of(conditions)
    places = list(places_of(campaign.robot, varied))
    found: dict[str, Any] = {"varied": " ".join(varied), "places": digest(places)}
    rng = np.random.default_rng(5)
    for variable in varied:
        for kind in ("screw", "compliance"):
            for shape in dict.fromkeys(
                [*first_shapes(campaign.robot, variable),
                 *all_shapes(conditions, variable, kind)]
            ):  # fmt: skip
                columns, mixed = sensitivities.basis(variable, shape)
                key = f"{shape.form} {kind}"
                found.setdefault(key, []).append([
                    columns,
                    mixed @ mixed.T,
                    shape.given,
                ])
    frame = campaign.robot.frames[-1].name
    for parts, kind in (
        (
            ((frame, ("rx", "ty"), varied[0]), ("base", ("tz", "rz"), varied[-1])),
            "screw",
        ),
        ((("reading", ("tx", "ry", "tz"), varied[0]),), "screw"),
        (((frame, ("tx",), varied[0]), (frame, ("rz",), varied[-1])), "compliance"),
    ):
        for shape in first_shapes(campaign.robot, varied[0])[:2]:
            one = Candidate(tuple(CandidatePart(*part) for part in parts), kind, shape)
            changes = sensitivities.changes(one)
            x = 1e-4 * rng.normal(size=changes.shape[2])
            third = len(shape.names)
            some = np.where(np.arange(len(x)) < third, 1e-15 * x, x)
            few = sensitivities.take(np.array([3, 1, 7]))
            found.setdefault("candidates", []).append([
                changes, sensitivities.moved(one, x), sensitivities.axes(one),
                sensitivities.fitted(one, x, np.abs(x)),
                sensitivities.fitted(one, some, np.abs(x)), few.moved(one, x),
            ])  # fmt: skip
    return found


def tangents(name: str, nudge: float) -> Any:
    """How every hypothesis shows in some rows, about its start and elsewhere."""
    campaign, conditions = rows(name, nudge)
    at = Tangents(campaign, conditions)
    found = []
    for h in hypotheses(conditions, loaded_components(campaign)):
        if LIBRARY[h.effect].finite or LIBRARY[h.effect].clearance:
            continue
        start = at.at_start(h)
        found.append([h.effect, h.bounds, start.offset, start.columns])
        if h.slots:
            x = h.start + [0.3 * slot.unknown.scale for slot in h.slots]
            found[-1] += [h.public(campaign.robot, x), at.about(h, x, {}).columns]
    return found


def doubted(name: str, nudge: float) -> Any:
    """Rows of a campaign with repeats, blunders and odd covariates; odd numbers."""
    campaign = read_campaign(CAMPAIGNS / name)
    count = len(campaign)
    rng = np.random.default_rng(6)
    z = rng.normal(size=(count, 6)) * (1 + nudge)
    z[::7] *= 3.0
    z[5], z[11] = 40.0, 25.0
    heat = 20.0 + np.arange(count) % 5
    heat[3] = 400.0
    repeated = replace(
        campaign, repeat=np.arange(count) // 3,
        configuration=np.arange(count) // 3,
        covariates={"temperature": heat, "time": 60.0 * np.arange(count)[::-1]},
    )  # fmt: skip
    residual = z[campaign.cells]
    robot = campaign.robot
    learned = learned_range(campaign, np.arange(count) < count // 2)
    narrow = {key: (low, (low + high) / 2) for key, (low, high) in learned.items()}
    said = []
    for size in (FAINT, PLAIN, ABSURD, -ABSURD):
        for h in hypotheses(conditions_of(campaign), ["fz"]):
            x = [slot.start + size * slot.unknown.scale for slot in h.slots]
            fit: Any = SimpleNamespace(effects={h.effect: h.public(robot, x)})
            said.append([h.effect, implausible(campaign, fit, NOTHING)])
    return {
        "lack": [lack_of_fit(repeated, residual, k) for k in (0, 7, 10**4)],
        "noise": [believed_noise(c, residual) for c in (campaign, repeated)],
        "outlying": [outlying(campaign, residual, m, w) for m in (None, 1, 9)
                     for w in (False, True)],
        "impossible": impossible_rows(repeated), "said": said,
        "split": [[split(c), *blocks_of(c)] for c in (campaign, repeated)],
        "learned": learned,
        "beyond": beyond(replace(robot, learned_range=narrow), campaign),
    }  # fmt: skip


def function_units(nudge: float) -> Any:
    """Units of the parameters of every form at places and variables of every kind."""
    del nudge  # no number goes in
    robot = load_robot("five_bar")
    first = next(f.name for f in robot.frames if f.actuated)
    variables = (
        f"q.{first}", "load.mx", "load.fy", f"wrench.{first}.mz", f"wrench.{first}.fx",
        "position.x", "cov.temperature", "time", "approach", "cov.humidity",
    )  # fmt: skip
    places = (
        ("reading", ("tx", "ry"), "screw"), ("load", ("fx", "my"), "screw"),
        (first, ("rz", "ty"), "screw"), (first, ("rz", "ty"), "compliance"),
    )  # fmt: skip
    found = {}
    for form, names in NUMBERS.items():
        for k, variable in enumerate(variables):
            said = []
            for where, components, kind in places:
                one = Function(
                    where, components, (variable,), form,
                    dict.fromkeys((f"{c}.{n}" for c in components for n in names), 1.0),
                    kind,
                )  # fmt: skip
                said.append(" ".join(units_of(robot, one).values()))
            found[f"{form}{k}"] = ", ".join(said)
    return found


INNER: dict[str, Callable[[float], Any]] = {
    **{f"steps {seed}": partial(steps, seed) for seed in range(3)},
    "scored": scored,
    **{f"small, {n}": partial(small, n) for n in ("self_weight", "thermal_expansion")},
    **{f"candidates, {n}": partial(candidates, n)
       for n in ("base_compliance_drift", "thermal_expansion")},
    **{f"tangents, {n}": partial(tangents, n)
       for n in ("encoder_offset", "thermal_expansion")},
    **{f"doubted, {n}": partial(doubted, n)
       for n in ("base_compliance_drift", "self_weight")},
    "units of forms": function_units,
}  # fmt: skip
