"""Questions to single parts, for ``answers_for_tests.py``: beams, surfaces, meshes;
effects and functions; hypotheses and what the readings tell of them."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from assembly.effects import LIBRARY, apply_effects
from assembly.effects.functions import apply_functions
from assembly.measurement.predict import predict, with_second_order
from assembly.measurement.settled_clearance import with_clearances_taken_up
from assembly.measurement.variables import with_history
from assembly.model.function import Function
from stiffness.beam.beam import beam_compliance
from stiffness.beam.beam_stress import peak_beam_stress, section_stress
from stiffness.beam.curve import arc_piece, curve_compliance, straight_piece
from stiffness.beam.curve_file import read_curve
from stiffness.beam.sections import (
    box_section,
    i_section,
    rectangular_section,
    round_section,
)
from stiffness.fem.adaptive_step import (
    estimated_error,
    middle_stiffness,
    refine_level,
    solve_level,
)
from stiffness.fem.material import Material
from stiffness.fem.quality import dihedral_angles, mesh_report
from stiffness.mesh.curved_elements import curved_elements
from stiffness.mesh.edge_grading import layered
from stiffness.mesh.lagrange import lattice, shape_functions
from stiffness.mesh.quadrature import quadrature
from stiffness.mesh.refine import refine
from stiffness.mesh.solid import Solid
from stiffness.surface.beam_surfaces import shape_beam, shape_surface
from stiffness.surface.interface import parse_interface
from stiffness.surface.intersections import crossing_triangles
from stiffness.surface.patches import find_patches
from stiffness.surface.primitives import project
from stiffness.surface.surface import check_surface, read_surface
from tests.solids_for_tests import bar_solid, box_solid, cylinder, masked_solid
from validation.campaign.campaign_file import read_campaign
from validation.diagnosis.hypotheses import hypotheses
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import conditions_of, loaded_components

TESTS = Path(__file__).parent
MESHES = TESTS.parent / "meshes"
E, NU = 7e10, 0.31
WRENCHES = np.array([[3, -2, 1, 20, -10, 30], [0.1, 4, -5, -3, 8, 0.2]])
SHAPES = {
    "round": {"radius": 0.02, "length": 0.3},
    "tube": {"radius": 0.02, "inner_radius": 0.011, "length": 0.3},
    "cone": {"radius": 0.03, "tip_radius": 0.02, "length": 0.3},
    "rectangle": {"width": 0.02, "height": 0.03, "length": 0.3},
    "box": {"width": 0.02, "height": 0.03, "wall": 0.004, "length": 0.3},
}
ENDS = {
    "distal_plain": ("z=0", "z=0.452"),
    "distal_forks": ("bore=0,0,0/0,1,0/0.011", "bore=0,0,0.452/0,1,0/0.011"),
    "tapered_arm": ("z=0", "z=0.35"),
    "l_bracket": ("z=0", "x=0.15"),
    "delta_forearm": ("z=0", "z=0.4"),
}


def sections(nudge: float) -> Any:
    """Constants and stresses of sections, compliances of straight and curved beams."""
    a = 0.02 * (1 + nudge)
    found = {
        "round": [round_section(a, nu, hole) for nu in (0, NU) for hole in (0, 0.007)],
        "rectangle": [rectangular_section(a, h, NU) for h in (0.01, 0.02, 0.05)],
        "box": [box_section(a, h, 0.003, NU) for h in (0.013, 0.02, 0.05)],
        "i": [i_section(a, h, 0.004, 0.003, NU) for h in (0.03, 0.06)],
    }
    given = (
        {"radius": a}, {"radius": a, "inner_radius": 0.012},
        {"width": a, "height": 0.035}, {"width": a, "height": 0.03, "wall": 0.002},
    )  # fmt: skip
    of_each = [s for some in found.values() for s in some]
    axis, up = [0.1, -0.2, 0.3], [0.3, 1.0, 0.2]
    pieces = [
        straight_piece([0, 0, 0], [0.1, 0, 0.02], found["i"][0], [0, 0, 1]),
        arc_piece([0.1, 0, 0.02], [0.1, 0.15, 0.02], [0, 0, 0.7], found["box"][2]),
    ]
    end = pieces[1].place(1.0)
    pieces.append(
        straight_piece(
            end, end + [0.1, 0, 0.1], lambda t: round_section(a * (2 - t), NU)
        )
    )
    return found | {
        "stress": [section_stress(s) for s in given],
        "peaks": [peak_beam_stress(s, 0.3, WRENCHES) for s in given],
        "straight": [
            beam_compliance(0.3, s, E, NU, axis=axis, up=up, theory=theory)
            for s in of_each
            for theory in ("timoshenko", "euler")
        ],
        "curved": [
            curve_compliance(some, E, NU, theory=theory)
            for some in (pieces, pieces[:2], pieces[2:])
            for theory in ("timoshenko", "euler")
        ],
    }


CURVE = """
[[piece]]
start = [0.0, 0.01, {start}]
section = {{ width = 0.02, height = 0.03, wall = 0.002 }}
end = [0.1, 0.01, 0.02]
[[piece]]
center = [0.1, 0.11, 0.02]
turn = [0, 0, 0.6]
[[piece]]
section = {{ radius = 0.01, inner_radius = 0.004 }}
tip_section = {{ radius = 0.008, inner_radius = 0.003 }}
end = [0.3, 0.1, 0.02]
[[piece]]
end = [0.35, 0.1, 0.1]
up = [0, 1, 0]
"""


def written(nudge: float) -> Any:
    """A curved beam from its file; a surface of no known shape, and what is nearest."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "curve.toml"
        path.write_text(CURVE.format(start=repr(0.02 * (1 + nudge))))
        curve = curve_compliance(read_curve(path, NU), E, NU)
    points, triangles = cylinder(0.02, 0.1 * (1 + nudge), 24)
    x, y, z = points.T
    bent = np.column_stack([x + 8 * z * x + 0.2 * y * y / 0.02, 1.3 * y, z])
    surface = check_surface(bent, triangles, "bent")
    ends = (
        parse_interface("z=0"),
        replace(parse_interface("z=0.1"), point=np.array([0, 0, 0.1 * (1 + nudge)])),
    )
    patches = find_patches(surface, *ends)
    near = np.random.default_rng(3).uniform(-0.03, 0.03, (5, 3)) + [0, 0, 0.05]
    return {
        "curve": curve,
        "patches": patches,
        "nearest": [project(near, (shape,)) for shape in patches.shapes],
    }


def shapes(nudge: float) -> Any:
    """Surfaces of simple shapes, and their beams."""
    found = {}
    for name, lengths in SHAPES.items():
        sizes = {key: size * (1 + nudge) for key, size in lengths.items()}
        pieces = shape_beam(name, sizes, NU)
        found[name] = shape_surface(name, sizes), curve_compliance(pieces, E, NU)
    return found


def surface(name: str, nudge: float) -> Any:
    """Patches of a surface and what was recognised in them."""
    base, tip = map(parse_interface, ENDS[name])
    read = read_surface(MESHES / f"{name}.stl")
    read = replace(read, points=read.points * (1 + nudge))
    return {
        "surface": read,
        "patches": find_patches(read, base, tip),
        "crossing": crossing_triangles(read.points, read.triangles),
    }


def solids(nudge: float) -> list:
    """Skewed solids, no two edges alike; one has an edge that points inwards."""
    size = np.array([0.04, 0.05, 0.1])
    straight = [
        bar_solid(2, 3, 0.03, 0.1),
        box_solid((2, 1, 2), size),
        masked_solid((2, 2, 2), size, lambda c: ~(c[:, 0] * c[:, 2] > 0.0012)),
    ]
    return [skewed(solid, nudge) for solid in straight]


def skewed(solid: Solid, nudge: float) -> Solid:
    """A solid without symmetries and of unknown sides; its ends stay planes."""
    x, y, z = solid.points.T * (1 + nudge)
    points = np.column_stack([x + 0.13 * y + 2 * x * z, y + 0.07 * z + 3 * y * x, z])
    return replace(solid, points=points, shapes=(*solid.shapes[:2], None))


def meshes(nudge: float) -> Any:
    """Meshes refined, curved and layered; elements' shape functions and quadrature."""
    found = []
    for solid in solids(nudge):
        halvings = np.arange(len(solid.cells)) % 3
        curved = curved_elements(solid, 3)
        found.append({
            "refined": refine(solid, halvings),
            "curved": curved,
            "layered": layered(solid, (0, 1)),
            "angles": dihedral_angles(solid),
        })
    L = lattice(2) * 0.8 + 0.05
    elements = [
        (lattice(d, c), quadrature(d, c)) for d in (1, 2, 3, 4) for c in (3, 4)
    ] + [shape_functions(d, L) for d in (1, 2, 3, 4)]
    return {"solids": found, "elements": elements}


def levels(interface: str, nudge: float) -> Any:
    """A level of a short bar and a finer one: stiffness, estimated errors, middle."""
    solid = bar_solid(1, 2, 0.03 * (1 + nudge), 0.06)
    if interface != "rigid":
        solid = skewed(solid, nudge)
    materials = [Material(E, NU, 2700.0)]
    centers = np.array([[0.0, 0, 0], [0.001, 0, 0.06]])
    level = solve_level(solid, materials, centers, interface)
    finer = refine_level(level, 2.0)
    totals = level.totals()
    error, index = estimated_error([totals])
    return {
        "level": level,
        "report": mesh_report(level.solid, level.mesh),
        "finer": finer,
        "error": (error, index),
        "middle": middle_stiffness(totals[0], error, totals[2]),
    }


def rows(name: str, nudge: float, count: int = 12) -> Any:
    """Conditions of some rows of a campaign, and the campaign."""
    campaign = read_campaign(TESTS / "campaigns" / name)
    campaign = replace(campaign, loads=campaign.loads * (1 + nudge))
    campaign = campaign.take(np.arange(len(campaign)) < count)
    return campaign, conditions_of(campaign)


def effects(name: str, nudge: float) -> Any:
    """What each effect of the library, at its usual size, adds to the readings."""
    _, conditions = rows(name, nudge)
    robot, found = conditions.robot, {}
    for key, effect in LIBRARY.items():
        unknowns = effect.unknowns(robot)
        places = effect.frames(robot) if effect.frames else ("",)
        values = {}
        for k, place in enumerate(places):
            for u in unknowns:
                size = u.start + 0.7 * u.scale / (1 + k)
                full = f"{place}.{u.name}" if place and u.name else place or u.name
                values[full] = float(np.clip(size, u.lower, u.upper))
        public = effect.public(robot, values)
        units = [effect.unit(robot, one) for one in public]
        changed = apply_effects(conditions, {key: public})
        found[key] = {"unknowns": unknowns, "public": public, "units": units}
        if not effect.finite:
            read = predict(with_clearances_taken_up(changed)[0])
            found[key] |= {"read": read.deviation, "reason": list(read.reason)}
    some = conditions.take(np.arange(3))
    found["finite"] = with_second_order(some).second_order
    return found


DRIVE = "q.leg1.drive"
WHERE: Any = {"where": "leg1.drive", "components": ("rz",), "variables": (DRIVE,)}
FUNCTIONS = [
    Function(**WHERE, form="powers", parameters={"0": 1e-4, "1": 2e-4, "2": -1e-4}),
    Function(
        **WHERE | {"variables": (DRIVE, "load.fx")}, form="powers",
        parameters={"1.1": 1e-5, "0.1": -2e-5, "2.0": 3e-5},
    ),
    Function(
        **WHERE, form="waves",
        parameters={"1.sine": 2e-4, "2.cosine": 1e-4, "period": 0.7},
    ),
    Function(
        **WHERE, form="spline",
        parameters={"first": -1.5, "last": 1.0, "1": 1e-4, "2": -2e-4, "3": 3e-4},
    ),
    *(
        Function(
            "reading", ("tx", "rz"), ("cov.temperature",), form,
            {"gain": 1e-5, "start": 2e-5, "time_constant": 200.0},
        )
        for form in ("lag", "creep")
    ),
    Function("base", ("ty",), ("cov.time",), "step", {"at": 400.0, "size": 3e-5}),
    Function(
        "reading", ("tz",), ("cov.time",), "slow_wave",
        {"period": 900.0, "sine": 1e-5, "cosine": 2e-5},
    ),
    Function(**WHERE, form="reversal", parameters={"0": 1e-4}),
    Function("load", ("fx",), ("load.fx",), "powers", {"1": 0.1, "2": 1e-3}),
    Function(
        **WHERE | {"variables": ("wrench.leg1.drive.mz",)}, form="powers",
        parameters={"1": 1e-5, "3": 1e-7}, kind="screw",
    ),
    Function(**WHERE, form="powers", parameters={"0": 1e-5}, kind="compliance"),
]  # fmt: skip


def functions(nudge: float) -> Any:
    """What functions of every form, place and kind add to the readings."""
    _, conditions = rows("base_compliance_drift", nudge)
    conditions = with_history(conditions)
    return {
        f"function_{k}": predict(apply_functions(conditions, [one])).deviation
        for k, one in enumerate(FUNCTIONS)
    }


def signatures(name: str, nudge: float) -> Any:
    """Hypotheses about a campaign, and how they would show."""
    campaign, conditions = rows(name, nudge)
    some = hypotheses(conditions, loaded_components(campaign))
    return {"hypotheses": some, "responses": responses(conditions.take(np.arange(4)))}


PARTS: dict[str, Callable[[float], Any]] = {
    "sections": sections,
    "shapes": shapes,
    "written": written,
    **{f"surface {name}": partial(surface, name) for name in ENDS},
    "meshes": meshes,
    **{f"level, {i}": partial(levels, i) for i in ("rigid", "distributing-both")},
    **{f"effects of {c}": partial(effects, c)
       for c in ("encoder_offset", "base_compliance_drift")},
    "functions": functions,
    **{f"signatures, {c}": partial(signatures, c)
       for c in ("encoder_offset", "base_compliance_drift")},
}  # fmt: skip
