"""Compute errors due to the assumptions of the virtual-joint model.

Run ``python benchmarks/evidence/crosscheck_validity.py``, which takes five minutes.  It
prints the tables of ``docs/validity.md``, and writes the figures and ``validity.json``
to ``docs/`` or to a given folder.

There are 4 sets of random geometric errors at each of 5 poses. The magnitude of a set
of errors is the largest rotation error in rad. The largest translation error in m is a
hundredth of this number. Joints have no clearance, except for the comparison of disc
and cone.
"""

import itertools
import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from crosscheck_robots import drawn, hexapod, papers_robot
from validity_figures import pose_figure, validity_figure
from validity_models import bush_margin, halves_cost, with_bars

from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.kinematics.posture import Posture, place_robot
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, MeshLink, Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.validation.assumptions.solid_links import solid_links
from forcefit.validation.assumptions.validity import (
    Cost,
    bush_cost,
    closure_cost,
    link_cost,
    spread_cost,
)
from forcefit.validation.multibody.simulation import without_clearance

FORKS = Path(__file__).parents[2] / "meshes" / "distal_forks.stl"
REFERENCES = Path(__file__).with_name("stiffness_references.json")
BORES = ("bore=0,0,0/0,1,0/0.011", "bore=0,0,0.452/0,1,0/0.011")
PAPER = 0.02  # [rad] geometric errors of the paper
SIZES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.04)  # [rad]
BARS = (3.0, 5.0, 8.0, 11.3, 16.0, 24.0)  # [-] ratio of length to radius
WEIGHT_BARS = (5.0, 10.0, 20.0, 40.0, 80.0)
DENSITY = {"irsbot2": 2700.0, "hexapod": 7850.0}
DOWN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -1000.0])  # [N]
GRAVITY = np.array([0.0, 0.0, -9.81])
POSES = {
    "irsbot2": [
        {"tx": x, "tz": z}
        for x, z in ((0.0, -0.5), (0.2, -0.45), (-0.2, -0.45), (0.4, -0.45),
                     (-0.4, -0.35))
    ],
    "hexapod": [
        {}, {"tx": 0.1, "tz": 0.6}, {"ty": -0.1, "tz": 0.7}, {"rx": 0.2, "tz": 0.65},
        {"rz": 0.4, "tz": 0.6},
    ],
}  # fmt: skip


def erring(name: str, seed: int) -> Robot:
    """Return a robot with random errors; signs are random only for odd seeds."""
    if name == "irsbot2":
        return papers_robot(seed, signed=seed % 2 == 1)
    return drawn(hexapod(play=True), seed, PAPER, PAPER / 100)


def postures(name: str, slenderness: float | None = None, play: bool = False) -> list:
    """Return twenty postures of a robot with the errors of the paper."""
    cases = []
    for pose, seed in itertools.product(POSES[name], range(4)):
        robot = erring(name, seed) if play else without_clearance(erring(name, seed))
        if slenderness is not None:
            robot = with_bars(robot, slenderness, DENSITY[name])
        cases.append(place_robot(robot, pose))
    return cases


def free_of_errors(cases: Iterable[Posture]) -> list[Posture]:
    """Return a posture without errors at each pose."""
    none = [
        replace(c, robot=c.robot.with_errors(np.zeros_like(c.robot.errors)))
        for c in cases
    ]
    return none[::4]


def resized(cases: Iterable[Posture], factor: float) -> list[Posture]:
    """Return the postures with errors multiplied by a factor."""
    return [
        replace(c, robot=c.robot.with_errors(factor * c.robot.errors)) for c in cases
    ]


def row(
    head: tuple[str, str, str, float], cases: Iterable[Posture],
    cost: Callable[..., Cost], *arguments: object,
) -> dict:  # fmt: skip
    """Return the median and the largest error of all postures as a row of a table."""
    costs = []
    for posture in cases:
        try:
            costs.append(cost(posture, *arguments))
        except SolverFailed as error:
            print(*head, error, file=sys.stderr)
    names = ("rotation", "position", "energy")
    columns = {k: [getattr(c, k) for c in costs] for k in names}
    spread = {k: [float(np.median(v)), float(max(v))] for k, v in columns.items()}
    beyond = float(np.mean([c.matters for c in costs]))
    named = dict(zip(("robot", "assumption", "case", "x"), head, strict=True))
    return named | spread | {"beyond": beyond, "cases": len(costs)}


def closures(name: str) -> Iterable[dict]:
    """Yield errors of assumption (a), linear loop closures."""
    kinds = (("as built", None, None), ("1 kN", None, DOWN), ("L / r = 40", 40.0, None))
    for case, slenderness, load in kinds:
        cases = postures(name, slenderness)
        for size in SIZES:
            erred = resized(cases, size / PAPER)
            yield row((name, "closures", case, size), erred, closure_cost, load)


def beams(name: str) -> Iterable[dict]:
    """Yield errors of assumption (b), links as beams, for different slenderness."""
    for slenderness in BARS:
        cases = postures(name, slenderness)
        none = free_of_errors(cases)
        bars = solid_links(cases[0].robot)
        solids = {frame: bar.condensed for frame, bar in bars.items()}
        for case, load, several in (("errors", None, cases), ("1 kN", DOWN, none)):
            head = (name, "beams", case, slenderness)
            yield row(head, several, link_cost, solids, load)


def weights(name: str) -> Iterable[dict]:
    """Yield errors of assumption (c), weight at the ends of links."""
    for slenderness in WEIGHT_BARS:
        cases = postures(name, slenderness)
        none = free_of_errors(cases)
        for case, cost, g, several in (
            ("clamped ends, 1 g", spread_cost, 1, none),
            ("clamped ends, 1 g, errors", spread_cost, 1, cases),
            ("halves, 1 g", halves_cost, 1, none),
            ("halves, 10 g", halves_cost, 10, none),
        ):
            head = (name, "weights", case, slenderness)
            yield row(head, several, cost, g * GRAVITY)


def discs(name: str) -> Iterable[dict]:
    """Yield errors of assumption (d), clearances as discs and cones."""
    cases = postures(name, play=True)
    for case, load in (("no load", None), ("1 kN", DOWN)):
        for size in SIZES:
            erred = resized(cases, size / PAPER)
            yield row((name, "discs", case, size), erred, bush_cost, load)


def print_margins(name: str) -> None:
    """Print the factor by which the model with two bushes increases the margin."""
    for compliant in ("rigid", "free"):
        factors = []
        for at in postures(name, play=True):
            disc = zone_margin(at, compliant).margin
            bushes = bush_margin(at, compliant)
            if disc and np.isfinite(bushes):
                factors.append(bushes / disc)
        if factors:
            costs = np.percentile(factors, [0, 50, 100])
            print(name, f"margin, compliant {compliant}: bushes / disc", costs.round(3))


def forks() -> Iterable[dict]:
    """Yield errors of assumption (b) for tubes with forks and bearing bores."""
    mesh = MeshLink(FORKS, *BORES, 60e9, 0.3)
    cases = postures("irsbot2")
    names = [f.name for f in cases[0].robot.frames if f.link is not None]
    frame = replace(cases[0].robot.frame(names[0]), link=mesh)
    frame = replace(frame, link=solved_link(frame))
    solids = dict.fromkeys(names, np.linalg.inv(link_compliance(frame)))
    for case, section in (
        ("bar, r = 40 mm", {"radius": 0.04}),
        ("tube, 80 x 6 mm", {"radius": 0.04, "inner_radius": 0.034}),
    ):
        beam = BeamLink(section, 60e9, 0.3)
        built = [
            replace(c, robot=c.robot.with_links(dict.fromkeys(names, beam)))
            for c in cases
        ]
        head = ("irsbot2", "forks", case, 11.3)
        yield row(head, built, link_cost, solids)


def rods() -> Iterable[dict]:
    """Yield errors of assumption (b) for a hexapod with steel tubes as legs.

    The stiffness of ``meshes/delta_forearm.stl`` is computed by
    ``stiffness_references.py`` for 60 GPa.
    """
    kept = json.loads(REFERENCES.read_text())["delta_forearm"]["stiffness"]
    z_to_x = np.kron(np.eye(2), [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    solid = z_to_x @ np.array(kept) @ z_to_x.T * (200 / 60)
    cases = postures("hexapod")
    names = [f.name for f in cases[0].robot.frames if f.link is not None]
    solids = dict.fromkeys(names, solid)
    for shape, section in (
        ("bar, r = 7 mm", {"radius": 0.007}),
        ("tube, 14 x 2 mm", {"radius": 0.007, "inner_radius": 0.005}),
    ):
        beam = BeamLink(section, 200e9, 0.3, length=0.4, axis=(1.0, 0.0, 0.0))
        built = [
            replace(c, robot=c.robot.with_links(dict.fromkeys(names, beam)))
            for c in cases
        ]
        none = free_of_errors(built)
        for case, load, several in (("errors", None, built), ("1 kN", DOWN, none)):
            head = ("hexapod", "rods", f"{shape}, {case}", 0.4 / 0.007)
            yield row(head, several, link_cost, solids, load)


def over_poses(name: str) -> dict:
    """Return median errors over the workspace for 3 sets of random errors."""
    if name == "irsbot2":
        xs, zs = np.arange(-0.4, 0.41, 0.1), np.arange(-0.6, -0.19, 0.1)
    else:
        xs, zs = np.arange(-0.2, 0.21, 0.1), np.arange(0.5, 0.81, 0.1)
    maps = {k: np.full((len(zs), len(xs), 2), np.nan) for k in ("closures", "discs")}
    for (i, z), (j, x) in itertools.product(enumerate(zs), enumerate(xs)):
        tight, loose = [], []
        for seed in range(3):
            robot = erring(name, seed)
            try:
                at = place_robot(robot, {"tx": float(x), "tz": float(z)})
                loose.append(bush_cost(at))
                tight.append(closure_cost(replace(at, robot=without_clearance(robot))))
            except (ValueError, SolverFailed):
                continue
        for key, costs in (("closures", tight), ("discs", loose)):
            if costs:
                values = [(c.position, c.energy) for c in costs]
                maps[key][i, j] = np.median(values, axis=0)
    return {"x": xs, "z": zs, **maps}


def print_table(rows: list[dict]) -> None:
    """Print the median and largest errors as a Markdown table."""
    print(
        "| robot | case | x | position [um] | rotation [urad] | energy [%] | beyond |"
    )
    print("|---|---|---|---|---|---|---|")
    for r in rows:
        cells = [
            f"{unit * r[k][0]:.2g} ({unit * r[k][1]:.2g})"
            for k, unit in (("position", 1e6), ("rotation", 1e6), ("energy", 100))
        ]
        x = 1e3 * r["x"] if r["assumption"] in {"closures", "discs"} else r["x"]
        print(f"| {r['robot']} | {r['case']} | {x:g} |", " | ".join(cells),
              f"| {100 * r['beyond']:.0f} % |", flush=True)  # fmt: skip


def main() -> None:
    """Compute, print and write all results."""
    folder = Path(
        sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[2] / "docs"
    )
    rows: list[dict] = []
    for name in POSES:
        for part in (closures(name), beams(name), weights(name), discs(name)):
            costs = list(part)
            print(f"\n{name}: {costs[0]['assumption']}\n")
            print_table(costs)
            rows += costs
        print_margins(name)
    print("\nreal shape\n")
    costs = [*forks(), *rods()]
    print_table(costs)
    rows += costs
    maps = {name: over_poses(name) for name in POSES}
    validity_figure(rows).savefig(folder / "validity.png", dpi=80)
    pose_figure(maps).savefig(folder / "validity_poses.png", dpi=80)
    (folder / "validity.json").write_text(json.dumps(rows, indent=0) + "\n")


if __name__ == "__main__":
    main()
