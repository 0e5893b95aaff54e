"""Compliances and stresses of beams for ``answers_for_tests.py``."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.beam_stress import peak_beam_stress, section_stress
from forcefit.stiffness.beam.curve import arc_piece, curve_compliance, straight_piece
from forcefit.stiffness.beam.curve_file import read_curve
from forcefit.stiffness.beam.sections import (
    box_section,
    i_section,
    rectangular_section,
    round_section,
)
from forcefit.stiffness.surface.beam_surfaces import shape_beam

E, NU = 7e10, 0.31
WRENCHES = np.array([[3, -2, 1, 20, -10, 30], [0.1, 4, -5, -3, 8, 0.2]])
SHAPES = {
    "round": {"radius": 0.02, "length": 0.3},
    "tube": {"radius": 0.02, "inner_radius": 0.011, "length": 0.3},
    "cone": {"radius": 0.03, "tip_radius": 0.02, "length": 0.3},
    "rectangle": {"width": 0.02, "height": 0.03, "length": 0.3},
    "box": {"width": 0.02, "height": 0.03, "wall": 0.004, "length": 0.3},
}


def sections(nudge: float) -> Any:
    """Compute stresses in cross sections and compliances of beams."""
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
    return {
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
    """Compute the compliance of a curved beam defined in a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "curve.toml"
        path.write_text(CURVE.format(start=repr(0.02 * (1 + nudge))))
        return {"curve": curve_compliance(read_curve(path, NU), E, NU)}


def shapes(nudge: float) -> Any:
    """Compute the compliance of a beam of each shape."""
    return {
        name: curve_compliance(
            shape_beam(name, {key: s * (1 + nudge) for key, s in sizes.items()}, NU),
            E, NU,
        )
        for name, sizes in SHAPES.items()
    }  # fmt: skip


BEAMS: dict[str, Callable[[float], Any]] = {
    "sections": sections,
    "shapes": shapes,
    "written": written,
}
