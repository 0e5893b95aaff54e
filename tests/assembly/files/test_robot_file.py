"""Robot files: what must load does, what must not says why, and both ways round."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from assembly.files.robot_file import read_robot, write_robot
from assembly.kinematics.posture import home_posture
from assembly.linear.energy import solve_assembly
from assembly.linear.mobility import mobility
from assembly.linear.reduction import FreeMotion
from assembly.model.robot import (
    BeamLink,
    Clearance,
    Frame,
    LibraryLink,
    MatrixLink,
    MeshLink,
    Robot,
)
from forcefit.inputs.table import BadInput

FOUR_BAR = """
name = "four_bar"
description = "a parallelogram"
platform = "coupler"

[[frame]]
name = "crank"
parent = "base"
joint = "revolute"
actuated = true
position = 1.0

[[frame]]
name = "elbow"
parent = "crank"
translation = [0.3, 0, 0]
joint = "revolute"
position = -1.0
clearance = { radial = 29e-6, spin = 3.0 }

[[frame]]
name = "coupler"
parent = "elbow"
translation = [0.5, 0.0, 0.0]
link = { beam = { radius = 0.04, inner_radius = 0.03 }, young = 6e10, poisson = 0.3 }
mass = 1.2

[[frame]]
name = "rocker"
parent = "base"
translation = [0.5, 0.0, 0.0]
joint = "revolute"
position = 1.0
joint_stiffness = [1e8, 1e8, 1.0, 3e8, 3e8, inf]

[[frame]]
name = "wrist"
parent = "rocker"
translation = [0.3, 0.0, 0.0]
joint = "revolute"
position = -1.0

[[frame]]
name = "seat"
parent = "wrist"

[[closure]]
frames = ["coupler", "seat"]
"""
SLIDER = """
name = "slider"
platform = "tool"
[[frame]]
name = "slide"
parent = "base"
joint = "prismatic"
actuated = true
position = 0.2
[[frame]]
name = "tool"
parent = "slide"
translation = [0.3, 0.0, 0.2]
rotation = [0.0, 1.5707963267948966, 0.0]
link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }
"""
BEAM = "beam = { radius = 0.04, inner_radius = 0.03 }"
LINK = f"link = {{ {BEAM}, young = 6e10, poisson = 0.3 }}"
SPRING = "joint_stiffness = [1e8, 1e8, 1.0, 3e8, 3e8, inf]"
PLAY = "clearance = { radial = 29e-6, spin = 3.0 }"


def mesh(surface="x.stl", tip='"z=0.5"', more=""):
    """A mesh in TOML."""
    return f'mesh = {{ surface = "{surface}", base = "z=0", tip = {tip}{more} }}'


def rows(changes):
    """6 rows of the unit matrix in TOML, some entries (counted from 1) changed."""
    K = [[changes.get((i, j), float(i == j)) for j in range(1, 7)] for i in range(1, 7)]
    return str(K)


def test_the_sound_files_are_sound(write_file):
    """Every row below changes one of these two, so its message is that change's."""
    robot = read_robot(write_file(FOUR_BAR))
    assert [f.name for f in robot.frames][:2] == ["crank", "elbow"]
    assert home_posture(robot).mismatch < 1e-12
    assert read_robot(write_file(SLIDER)).platform == "tool"


REFUSED = {
    "negative tolerance": (
        "mass = 1.2", "mass = 1.2\ntolerance = [0, 0, 1e-3, -1e-3, 0, 0]",
        'frame "coupler".tolerance: found -0.001 in it, expected 6 numbers >= 0 '),
    "limits the wrong way round": (
        "mass = 1.2", "mass = 1.2\njoint = \"revolute\"\nlimits = [1.0, -1.0]",
        'frame "coupler".limits: found [1, -1], expected the smaller one first'),
    "limits of a fixed joint": (
        "mass = 1.2", "mass = 1.2\nlimits = [-1.0, 1.0]",
        'frame "coupler".limits: found one on a fixed joint'),
    "tolerance of another shape": (
        "mass = 1.2", "mass = 1.2\ntolerance = [1e-3]",
        'frame "coupler".tolerance: found [0.001] of length 1, expected 6 finite '),
    "unknown key at the root": (
        'description = "', 'descripton = "',
        'unknown key "descripton"; did you mean "description"?'),
    "unknown key of a frame": (
        "mass = 1.2", "masss = 1.2",
        'frame "coupler": unknown key "masss"; did you mean "mass"?'),
    "unknown key of a clearance": (
        "spin = 3.0", "spinn = 3.0",
        'frame "elbow".clearance: unknown key "spinn"; did you mean "spin"?'),
    "unknown key of a link": (
        "poisson = 0.3 }", "poisson = 0.3, densty = 1.0 }",
        'frame "coupler".link: unknown key "densty"; did you mean "density"?'),
    "unknown key of a beam": (
        "inner_radius", "inner_radiu",
        'frame "coupler".link.beam: unknown key "inner_radiu"; did you mean '
        '"inner_radius"?'),
    "unknown key of a closure": (
        'frames = ["coupler", "seat"]', 'frames = ["coupler", "seat"]\nframe = 1',
        'closure[1]: unknown key "frame"; did you mean "frames"?'),
    "unknown key of dh": (
        "mass = 1.2", "mass = 1.2\n[[frame]]\nname = 'x'\nparent = 'base'\n"
        "dh = { tetha = 1 }",
        'frame "x".dh: unknown key "tetha"; did you mean "theta"?'),
    "no platform": (
        'platform = "coupler"', "", "platform: missing; expected the name of a frame"),
    "unknown platform": (
        'platform = "coupler"', 'platform = "coupler1"',
        'platform: found "coupler1", expected the name of a frame; did you mean '
        '"coupler"?'),
    "the base as platform": (
        'platform = "coupler"', 'platform = "base"',
        'platform: found "base"; expected a frame (add a fixed one whose parent is '
        "it)"),
    "a frame without a name": (
        'name = "seat"', "", "frame[6].name: missing; expected a string"),
    "a frame without a parent": (
        'parent = "wrist"', "",
        'frame "seat".parent: missing; expected the name of a frame, or "base"'),
    "an unknown parent": (
        'parent = "wrist"', 'parent = "wirst"',
        'frame "seat".parent: found "wirst", expected a frame of this robot or '
        '"base"; did you mean "wrist"?'),
    "a frame that is its own parent": (
        'parent = "wrist"', 'parent = "seat"',
        'frame "seat".parent: found "seat", and from there on a ring of parents; '
        'expected them to lead to "base"'),
    "a ring of parents": (
        'name = "rocker"\nparent = "base"', 'name = "rocker"\nparent = "seat"',
        'frame "rocker".parent: found "seat", and from there on a ring of parents; '
        'expected them to lead to "base"'),
    "a name given twice": (
        'name = "wrist"', 'name = "crank"',
        'frame[5].name: found "crank", already the name of frame[1]; expected '
        "another"),
    "a frame called base": (
        'name = "wrist"', 'name = "base"',
        'frame[5].name: found "base", already the name of the root; expected another'),
    "an empty name": (
        'name = "wrist"', 'name = " "', "frame[5].name: found ' ', expected a string"),
    "a name of two lines": (
        'name = "wrist"', 'name = "a\\nb"',
        "frame[5].name: found 'a\\nb', expected no control characters"),
    "a joint of another kind": (
        'joint = "revolute"\nactuated', 'joint = "revolut"\nactuated',
        'frame "crank".joint: found \'revolut\', expected "fixed" | "revolute" | '
        '"prismatic"; did you mean "revolute"?'),
    "a number for true": (
        "actuated = true", "actuated = 1",
        'frame "crank".actuated: found 1, expected true or false'),
    "a position of a fixed joint": (
        'joint = "revolute"\nactuated = true', "",
        'frame "crank".position: found one on a fixed joint; expected joint = '
        '"revolute" | "prismatic", or no such key'),
    "an actuated fixed joint": (
        'joint = "revolute"\nactuated = true\nposition = 1.0', "actuated = true",
        'frame "crank".actuated: found one on a fixed joint; expected joint = '
        '"revolute" | "prismatic", or no such key'),
    "a position that is no number": (
        "position = -1.0\nclearance", 'position = "1"\nclearance',
        'frame "elbow".position: found \'1\', expected a finite number [rad or m]'),
    "true for a number": (
        "mass = 1.2", "mass = true",
        'frame "coupler".mass: found true, expected a finite number >= 0 [kg]'),
    "a negative mass": (
        "mass = 1.2", "mass = -1.2",
        'frame "coupler".mass: found -1.2, expected a finite number >= 0 [kg]'),
    "nan": (
        "mass = 1.2", "mass = nan",
        'frame "coupler".mass: found nan, expected a finite number >= 0 [kg]'),
    "an infinite length": (
        "translation = [0.3, 0.0, 0.0]", "translation = [0.3, -inf, 0.0]",
        'frame "wrist".translation: found -inf as number 2, expected 3 finite numbers '
        "[m]"),
    "true in a vector": (
        "translation = [0.3, 0.0, 0.0]", "translation = [0.3, false, 0.0]",
        'frame "wrist".translation: found false as number 2, expected 3 finite '
        "numbers [m]"),
    "a vector too short": (
        "translation = [0.3, 0.0, 0.0]", "translation = [0.3, 0.0]",
        'frame "wrist".translation: found [0.3, 0.0] of length 2, expected 3 finite '
        "numbers [m]"),
    "a vector of vectors": (
        "translation = [0.3, 0.0, 0.0]", "translation = [[0.3], [0.0], [0.0]]",
        'frame "wrist".translation: found [0.3] as number 1, expected 3 finite numbers '
        "[m]"),
    "a length beyond any machine": (
        "translation = [0.3, 0.0, 0.0]", "translation = [3e6, 0.0, 0.0]",
        'frame "wrist".translation: found [3000000.0, 0.0, 0.0], expected numbers of '
        "size at most 1e+06 [m]"),
    "an integer that no float holds": (
        "mass = 1.2", f"mass = 1{'0' * 400}",
        'frame "coupler".mass: found an integer of 1329 bits, expected a finite number '
        ">= 0 [kg]"),
    "an integer that Python does not read": (
        "mass = 1.2", f"mass = 1{'0' * 5000}",
        "not valid TOML: found a whole number of thousands of digits"),
    "dh beside a translation": (
        "translation = [0.3, 0.0, 0.0]", "translation = [0.3, 0.0, 0.0]\ndh = {a = 1}",
        'frame "wrist".translation: found it beside "dh", which places the frame; '
        "expected one of them"),
    "dh beside a rotation": (
        "translation = [0.3, 0.0, 0.0]", "rotation = [0, 0, 0]\ndh = {a = 1}",
        'frame "wrist".rotation: found it beside "dh", which places the frame; '
        "expected one of them"),
    "a list for dh": (
        "translation = [0.3, 0.0, 0.0]", "dh = [0, 0, 0.3, 0]",
        'frame "wrist".dh: found [0, 0, 0.3, 0], expected a table'),
    "a negative clearance": (
        "radial = 29e-6", "radial = -29e-6",
        'frame "elbow".clearance.radial: found -2.9e-05, expected a finite number >= 0 '
        "[m]"),
    "an infinite clearance": (
        "spin = 3.0", "spin = inf",
        'frame "elbow".clearance.spin: found inf, expected a finite number >= 0 '
        "[rad]"),
    "a number for a clearance": (
        PLAY, "clearance = 1e-5",
        'frame "elbow".clearance: found 1e-05, expected a table'),
    "five stiffnesses": (
        SPRING, "joint_stiffness = [1, 2, 3, 4, 5]",
        'frame "rocker".joint_stiffness: found [1, 2, 3, 4, 5] of length 5, expected 6 '
        "diagonal terms > 0 or inf (number 3 may be 0: free), or 6 rows of 6 "
        "[N m/rad .. N/m]"),
    "a stiffness of zero": (
        SPRING, "joint_stiffness = [1, 0, 3, 4, 5, 6]",
        'frame "rocker".joint_stiffness: found 0 in it, expected 6 diagonal terms > 0 '
        "or inf (number 3 may be 0: free), or 6 rows of 6 [N m/rad .. N/m]"),
    "a locked bearing": (
        SPRING, "joint_stiffness = [inf, inf, inf, 2e8, 2e8, 2e8]",
        'frame "rocker".joint_stiffness: found inf along the own motion of a passive '
        "joint, which would lock it; expected 0 (free, as a bearing), a number > 0 (a "
        'spring), or joint = "fixed"'),
    "a free row that is not empty": (
        SPRING, f"joint_stiffness = {rows({(3, 3): 0, (3, 4): 1, (4, 3): 1})}",
        'frame "rocker".joint_stiffness: not positive definite: found 0 as term '
        "[3, 3] of the diagonal, expected > 0"),
    "a stiffness of minus infinity": (
        SPRING, "joint_stiffness = [1, 2, -inf, 4, 5, 6]",
        'frame "rocker".joint_stiffness: found -inf in it, expected 6 diagonal terms > '
        "0 or inf (number 3 may be 0: free), or 6 rows of 6 [N m/rad .. N/m]"),
    "nan in a joint's stiffness": (
        SPRING, f"joint_stiffness = {rows({(2, 3): math.nan})}",
        'frame "rocker".joint_stiffness: found nan as number 3 in row 2, expected 6 '
        "diagonal terms > 0 or inf (number 3 may be 0: free), or 6 rows of 6 "
        "[N m/rad .. N/m]"),
    "an integer no float holds in a joint's stiffness": (
        SPRING, f"joint_stiffness = [1, 2, 1{'0' * 400}, 4, 5, 6]",
        'frame "rocker".joint_stiffness: found an integer of 1329 bits as number 3, '
        "expected 6 diagonal terms > 0 or inf (number 3 may be 0: free), or 6 rows of "
        "6 [N m/rad .. N/m]"),
    "inf off the diagonal": (
        SPRING, f"joint_stiffness = {rows({(1, 2): math.inf, (2, 1): math.inf})}",
        'frame "rocker".joint_stiffness: found inf at [1, 2]; expected inf only on the '
        "diagonal, the rest of its row and column zero"),
    "something beside an inf": (
        SPRING, f"joint_stiffness = {rows({(1, 1): math.inf, (2, 1): 1, (1, 2): 1})}",
        'frame "rocker".joint_stiffness: found 1 at [1, 2]; expected inf only on the '
        "diagonal, the rest of its row and column zero"),
    "an asymmetric joint": (
        SPRING, f"joint_stiffness = {rows({(1, 2): 0.5})}",
        'frame "rocker".joint_stiffness: not symmetric: found [1, 2] = 5.000000e-01 '
        "but [2, 1] = 0.000000e+00, expected them equal"),
    "an indefinite joint": (
        SPRING, f"joint_stiffness = {rows({(1, 2): 2, (2, 1): 2})}",
        'frame "rocker".joint_stiffness: not positive definite: found -1.0e+00 as '
        "smallest eigenvalue once scaled to a unit diagonal, expected > 0"),
    "an asymmetric link": (
        LINK, f"link = {{ stiffness = {rows({(3, 6): 0.1})} }}",
        'frame "coupler".link.stiffness: not symmetric: found [3, 6] = 1.000000e-01 '
        "but [6, 3] = 0.000000e+00, expected them equal"),
    "a link that is soft in one direction": (
        LINK, f"link = {{ stiffness = {rows({(3, 3): -2.5})} }}",
        'frame "coupler".link.stiffness: not positive definite: found -2.5 as term '
        "[3, 3] of the diagonal, expected > 0"),
    "a singular link": (
        LINK, f"link = {{ stiffness = {rows({(1, 2): 1, (2, 1): 1})} }}",
        'frame "coupler".link.stiffness: not positive definite'),
    "an infinite link": (
        LINK, f"link = {{ stiffness = {rows({(4, 4): math.inf})} }}",
        'frame "coupler".link.stiffness: found inf as number 4 in row 4, expected 6 '
        "rows of 6 finite numbers [N m/rad .. N/m]"),
    "a link of 5 rows": (
        LINK, "link = { stiffness = [[1], [2], [3], [4], [5]] }",
        'frame "coupler".link.stiffness: found [[1], [2], [3], [4], [5]] of length 5, '
        "expected 6 rows of 6 finite numbers [N m/rad .. N/m]"),
    "a ragged link": (
        LINK, f"link = {{ stiffness = {rows({}).replace(', 1.0]]', ']]')} }}",
        'frame "coupler".link.stiffness: found [0.0, 0.0, 0.0, 0.0, 0.0] of length 5 '
        "in row 6, expected 6 rows of 6 finite numbers [N m/rad .. N/m]"),
    "a link of nothing": (
        LINK, "link = {}",
        'frame "coupler".link: found none of them, expected exactly one of "beam" | '
        '"stiffness" | "mesh" | "library"'),
    "a link of two kinds": (
        BEAM, f'{BEAM}, library = "x#y"',
        'frame "coupler".link: found "beam" and "library", expected exactly one of '
        '"beam" | "stiffness" | "mesh" | "library"'),
    "a misspelt kind of link": (
        BEAM, "beem = { radius = 0.04 }",
        'frame "coupler".link: unknown key "beem"; did you mean "beam"?'),
    "no Young's modulus": (
        "young = 6e10, ", "",
        'frame "coupler".link.young: missing; expected a finite number > 0 [Pa]'),
    "Young's modulus misspelt": (
        "young", "youngs",
        'frame "coupler".link.young: missing; expected a finite number > 0 [Pa]; found '
        '"youngs" instead'),
    "an incompressible link": (
        "poisson = 0.3", "poisson = 0.5",
        'frame "coupler".link.poisson: found 0.5, expected a finite number > -1 and < '
        "0.5 [-]"),
    "no section": (
        BEAM, "beam = {}",
        'frame "coupler".link.beam: found no section, expected one section: "radius" '
        '[, "inner_radius"] or "width", "height" or "area", "I_y", "I_z", "J", '
        '"shear_y", "shear_z"'),
    "two sections": (
        BEAM, "beam = { radius = 0.04, width = 0.1 }",
        'frame "coupler".link.beam: found "radius" and "width", expected one section'),
    "half a section": (
        BEAM, "beam = { width = 0.1, hight = 0.2 }",
        'frame "coupler".link.beam.height: missing; expected a finite number > 0 [m]; '
        'found "hight" instead'),
    "a tube with no wall": (
        "inner_radius = 0.03", "inner_radius = 0.04",
        'frame "coupler".link.beam.inner_radius: found 0.04, expected a finite number '
        ">= 0 and < 0.04 [m]"),
    "a bore without a radius": (
        BEAM, "beam = { inner_radius = 0.03 }",
        'frame "coupler".link.beam.radius: missing; expected a finite number > 0 [m]'),
    "a radius below any machine": (
        BEAM, "beam = { radius = 1e-30 }",
        'frame "coupler".link.beam.radius: found 1e-30, expected at least 1e-12 [m]'),
    "another beam theory": (
        BEAM, 'beam = { radius = 0.04, theory = "timoschenko" }',
        "frame \"coupler\".link.beam.theory: found 'timoschenko', expected "
        '"timoshenko" | "euler"; did you mean "timoshenko"?'),
    "a length without an axis": (
        BEAM, "beam = { radius = 0.04, length = 0.5 }",
        'frame "coupler".link.beam.axis: missing; expected "length" and "axis", or '
        "neither"),
    "an axis without a length": (
        BEAM, "beam = { radius = 0.04, axis = [1, 0, 0] }",
        'frame "coupler".link.beam.length: missing; expected "length" and "axis", or '
        "neither"),
    "an axis of zero": (
        BEAM, "beam = { radius = 0.04, length = 1, axis = [0, 0, 0] }",
        'frame "coupler".link.beam.axis: found [0.0, 0.0, 0.0], expected a direction'),
    "up along the beam": (
        BEAM, "beam = { width = 0.1, height = 0.2, up = [-2, 0, 0] }",
        'frame "coupler".link.beam.up: up = '),
    "a beam between two origins that are one": (
        "mass = 1.2", f"[[frame]]\nname = 'x'\nparent = 'base'\n{LINK}",
        'frame "x".link: found no distance from the parent; expected a '
        'translation, or a beam with "length" and "axis"'),
    "a mesh without a surface": (
        BEAM, 'mesh = { base = "z=0", tip = "z=0.5" }',
        'frame "coupler".link.mesh.surface: missing; expected a string'),
    "an interface of another syntax": (
        BEAM, mesh(tip='"z=half"'),
        'frame "coupler".link.mesh.tip: found '),
    "a number for an interface": (
        BEAM, mesh(tip="0.5"),
        'frame "coupler".link.mesh.tip: found 0.5'),
    "no interface": (
        BEAM, 'mesh = { surface = "x.stl", base = "z=0" }',
        'frame "coupler".link.mesh.tip: missing; expected an interface such as '
        '"z=0.452"'),
    "a bore without an axis": (
        BEAM, mesh(tip="{ bore = { point = [0, 0, 0], radius = 0.1 } }"),
        'frame "coupler".link.mesh.tip.bore.axis: missing; expected 3 finite numbers'),
    "an interface with an unknown key": (
        BEAM,
        mesh(tip="{ plane = { point = [0, 0, 0], normal = [0, 0, 1] }, raduis = 1 }"),
        'frame "coupler".link.mesh.tip: unknown key "raduis"; did you mean "radius"?'),
    "a bore with an unknown key": (
        BEAM,
        mesh(tip="{ bore = { point = [0,0,0], axis = [0,1,0], radius = 1, h = 2 } }"),
        'frame "coupler".link.mesh.tip.bore: unknown key "h"; valid: axis, point, '
        "radius"),
    "a mesh with an unknown key": (
        BEAM, mesh(more=", units = 1"),
        'frame "coupler".link.mesh: unknown key "units"; did you mean "unit"?'),
    "a stiffness beyond any machine": (
        LINK, f"link = {{ stiffness = {rows({(2, 2): 1e50})} }}",
        'frame "coupler".link.stiffness: found 1e+50 as term [2, 2], expected between '
        "1e-40 and 1e+40"),
    "a unit that is none": (
        BEAM, mesh(more=', unit = "mmm"'),
        "frame \"coupler\".link.mesh.unit: found 'mmm', expected \"m\" | "),
    "a mesh that knows up where the frame does not": (
        BEAM, mesh(more=", up = [1, 0, 0]"),
        'frame "coupler".up: missing; expected the "up" of the mesh and of the frame, '
        "or neither"),
    "up for a beam in the frame": (
        "mass = 1.2", "up = [0, 0, 1]",
        'frame "coupler".up: found one without a mesh; it fixes the roll of a mesh'),
    "a library without a key": (
        BEAM, 'library = "links.nc"',
        "frame \"coupler\".link.library: found 'links.nc', expected "
        '"path/to/library#key"'),
    "a closure of one frame": (
        '["coupler", "seat"]', '["coupler", "coupler"]',
        "closure[1].frames: found ['coupler', 'coupler'], expected two different frame "
        "names"),
    "a closure of three": (
        '["coupler", "seat"]', '["coupler", "seat", "crank"]',
        "closure[1].frames: found ['coupler', 'seat', 'crank'], expected two different "
        "frame names"),
    "a closure of numbers": (
        '["coupler", "seat"]', "[1, 2]",
        "closure[1].frames: found [1, 2], expected two different frame names"),
    "a closure with nobody": (
        '["coupler", "seat"]', '["coupler", "seta"]',
        'closure[1].frames: found "seta", expected the name of a frame; did you mean '
        '"seat"?'),
    "a closure with the base": (
        '["coupler", "seat"]', '["coupler", "base"]',
        'closure[1].frames: found "base"; expected a frame (add a fixed one whose '
        "parent is it)"),
    "a closure at a joint": (
        '["coupler", "seat"]', '["coupler", "wrist"]',
        'closure[1].frames: found a revolute joint at frame "wrist"; expected a fixed '
        "joint without clearance or joint_stiffness (add a frame after it)"),
    "a closure at a clearance": (
        'parent = "wrist"', 'parent = "wrist"\nclearance = { radial = 1e-5 }',
        'closure[1].frames: found clearance at frame "seat"; expected a fixed joint '
        "without clearance or joint_stiffness (add a frame after it)"),
    "a platform with a stiffness": (
        "mass = 1.2", "joint_stiffness = [1, 1, 1, 1, 1, 1]",
        'platform: found joint_stiffness at frame "coupler"; expected a fixed joint '
        "without clearance or joint_stiffness (add a frame after it)"),
    "a closure that does not hold": (
        "translation = [0.5, 0.0, 0.0]\njoint", "translation = [1.5, 0.0, 0.0]\njoint",
        'four_bar: closure[1] ("coupler", "seat") does not hold in the home pose: off '
        "by "),
    "one frame instead of many": (
        "[[closure]]", "[closure]",
        "closure: found {'frames': ['coupler', 'seat']}, expected tables "
        "[[closure]]"),
    "a description that is none": (
        'description = "a parallelogram"', "description = 3",
        "description: found 3, expected a string"),
    "a date for a number": (
        "mass = 1.2", "mass = 2024-01-31",
        'frame "coupler".mass: found datetime.date(2024, 1, 31), expected a finite '
        "number >= 0 [kg]"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), REFUSED.values(), ids=REFUSED)
def test_a_robot_file_is_refused_with_one_message(old, new, message, write_file):
    assert FOUR_BAR.count(old) >= 1, "the row changes nothing"
    path = write_file(FOUR_BAR.replace(old, new))
    with pytest.raises(BadInput, match=re.escape(f"{path}: {message}")) as caught:
        read_robot(path)
    assert "\n" not in str(caught.value)


CONTENTS = {
    "nothing": (b"", "platform: missing; expected the name of a frame"),
    "no frame": (b'platform = "a"', "frame: missing; expected 1 to 2000 [[frame]]"),
    "bytes": (bytes(range(256)) * 9, "byte 128 is not UTF-8"),
    "a picture": (b"\x89PNG\r\n\x1a\n\0\0", "byte 0 is not UTF-8"),
    "UTF-16": (FOUR_BAR.encode("utf-16"), "byte 0 is not UTF-8"),
    "prose": (b"Dear all, the robot is", "not valid TOML: Expected '=' after a key in"),
    "lists in lists": (b"a = " + b"[" * 9999, "not valid TOML: nested too deeply"),
    "tables in tables": (b"a." * 50_000 + b"a = 1", "not valid TOML: nested too"),
    "two values": (
        b"a = 1\na = 2",
        "not valid TOML: Cannot overwrite a value",
    ),
    "a gigantic key": (
        b'"' + b"key" * 10**6 + b'" = 1\nplatform = "a"',
        "unknown key ",
    ),
    "a gigantic value": (b'platform = "' + b"abc" * 10**6 + b'"', "platform: found "),
}


@pytest.mark.parametrize(("content", "message"), CONTENTS.values(), ids=CONTENTS)
def test_a_file_that_is_no_robot_is_not_printed(content, message, write_file):
    path = write_file(content)
    with pytest.raises(BadInput, match=re.escape(f"{path}: {message}")) as caught:
        read_robot(path)
    assert len(str(caught.value)) < len(str(path)) + 300
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_a_folder_is_named(tmp_path):
    with pytest.raises(BadInput, match="none.toml: cannot be read: No such file"):
        read_robot(tmp_path / "none.toml")
    with pytest.raises(BadInput, match="cannot be read: Is a directory"):
        read_robot(tmp_path)
    with pytest.raises(BadInput, match="cannot be read: "):
        read_robot("a\0b.toml")


def test_a_gigantic_name_is_cut_in_the_message(write_file):
    path = write_file(FOUR_BAR.replace('"wrist"', f'"{"w" * 10**6}"'))
    with pytest.raises(BadInput, match="of 1000000 characters, expected at most 200"):
        read_robot(path)


LOADS = {
    "byte order mark": lambda t: "\ufeff" + t,
    "CRLF": lambda t: t.replace("\n", "\r\n"),
    "integers for floats": lambda t: re.sub(r"\b(\d)\.0\b", r"\1", t),
    "quoted keys": lambda t: t.replace("radial =", '"radial" =').replace(
        "name =", "'name' ="
    ),
    "block tables": lambda t: t.replace(
        PLAY, "[frame.clearance]\nradial = 29e-6\nspin = 3.0"
    ),
    "dotted keys": lambda t: t.replace(
        PLAY, "clearance.radial = 29e-6\nclearance.spin = 3.0"
    ),
    "actuated = false on a fixed joint": lambda t: t.replace(
        "mass = 1.2", "mass = 1.2\nactuated = false\njoint = 'fixed'"
    ),
    "six rows for six terms": lambda t: t.replace(
        SPRING,
        "joint_stiffness = [[1e8,0,0,0,0,0], [0,1e8,0,0,0,0], [0,0,1,0,0,0],"
        "\n[0,0,0,3e8,0,0], [0,0,0,0,3e8,0], [0,0,0,0,0,inf]]",
    ),
    "zeros written out": lambda t: t.replace(
        "mass = 1.2", "mass = 1.2\ngeometric_error = [0,0,0,0,0,0]\nrotation = [0,0,0]"
    ),
    "dh": lambda t: t.replace("translation = [0.3, 0, 0]", "dh = { a = 0.3 }"),
    "comments": lambda t: t.replace("\n", " # really\n"),
}


@pytest.mark.parametrize("change", LOADS.values(), ids=LOADS)
def test_the_same_robot_written_by_others_is_the_same(change, write_file, tmp_path):
    expected = read_robot(write_file(FOUR_BAR))
    changed = change(FOUR_BAR)
    assert changed != FOUR_BAR
    assert_same_robot(read_robot(write_file(changed)), expected)


@pytest.mark.parametrize("seed", range(5))
def test_frames_may_come_in_any_order(seed, write_file):
    head, *frames = FOUR_BAR.split("[[frame]]")
    frames[-1], closure = frames[-1].split("[[closure]]")
    mixed = np.random.default_rng(seed).permutation(len(frames))
    text = "[[frame]]".join([head, *(frames[i] for i in mixed)])
    robot = read_robot(write_file(f"{text}[[closure]]{closure}"))
    expected = read_robot(write_file(FOUR_BAR))
    assert {f.name for f in robot.frames} == {f.name for f in expected.frames}
    here, there = home_posture(robot), home_posture(expected)
    np.testing.assert_allclose(here.platform, there.platform, rtol=0, atol=1e-12)


def test_dh_is_turn_shift_shift_turn(write_file):
    """Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha), multiplied by hand."""
    text = SLIDER.replace("translation = [0.3, 0.0, 0.2]\n", "").replace(
        "rotation = [0.0, 1.5707963267948966, 0.0]",
        "dh = { theta = 0.3, d = 0.1, a = 0.2, alpha = -1.1 }",
    )
    robot = read_robot(write_file(text))
    c, s, ca, sa = math.cos(0.3), math.sin(0.3), math.cos(-1.1), math.sin(-1.1)
    turn_z = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]])
    turn_x = np.array([[1, 0, 0, 0.2], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
    T = robot.fixed_transforms[robot.index("tool")]
    np.testing.assert_allclose(T, turn_z @ turn_x, rtol=0, atol=1e-15)


@pytest.mark.parametrize("given", ["theta", "d", "a", "alpha"])
def test_what_dh_leaves_out_is_zero(given, write_file):
    text = SLIDER.replace("translation = [0.3, 0.0, 0.2]\n", "").replace(
        "rotation = [0.0, 1.5707963267948966, 0.0]",
        f"dh = {{ {given} = 0.4 }}",
    ).replace("beam = { radius = 0.01 }",
              "beam = { radius = 0.01, length = 1, axis = [1, 0, 0] }")  # fmt: skip
    frame = read_robot(write_file(text)).frame("tool")
    place = {"theta": 5, "d": 2, "a": 0, "alpha": 3}[given]
    expected = np.zeros(6)
    expected[place] = 0.4
    here = np.concatenate([frame.translation, frame.rotation])
    np.testing.assert_allclose(here, expected, rtol=0, atol=1e-15)


def test_a_beam_below_a_slide_runs_between_the_origins_at_home(write_file):
    """0.2 m of the slide and [0.3, 0, 0.2] m of the frame: 3-4-5 times 0.1."""
    link = read_robot(write_file(SLIDER)).frame("tool").link
    assert link.length == pytest.approx(0.5, rel=1e-15)
    # the frame is turned by a quarter about y: its x is the slide's -z, its z is x
    np.testing.assert_allclose(link.axis, [-0.8, 0.0, 0.6], rtol=0, atol=1e-15)
    at_zero = read_robot(write_file(SLIDER.replace("position = 0.2", ""))).frame("tool")
    assert at_zero.link.length is None


def test_a_mesh_below_a_slide_that_is_not_at_zero_is_refused(write_file):
    path = write_file(SLIDER.replace("beam = { radius = 0.01 }", mesh()))
    with pytest.raises(BadInput, match=r'"tool"\.link\.mesh: found it below a prism'):
        read_robot(path)


def test_a_stiffness_printed_with_seven_digits_becomes_symmetric(write_file):
    K = rows({(1, 2): 0.1234567, (2, 1): 0.1234568})
    path = write_file(FOUR_BAR.replace(LINK, f"link = {{ stiffness = {K} }}"))
    K = read_robot(path).frame("coupler").link.stiffness
    np.testing.assert_array_equal(K, K.T)


def test_paths_lead_from_the_file_that_names_them(write_file, tmp_path):
    for path, expected in [
        ("meshes/x.stl", tmp_path / "meshes/x.stl"),
        ("../x.stl", tmp_path / "../x.stl"),
        ("/meshes/x.stl", Path("/meshes/x.stl")),
    ]:
        file = write_file(FOUR_BAR.replace(BEAM, mesh(path)))
        assert read_robot(file).frame("coupler").link.surface == expected
        file = write_file(FOUR_BAR.replace(LINK, f'link = {{ library = "{path}#k" }}'))
        assert read_robot(file).frame("coupler").link == LibraryLink(expected, "k")


def test_a_robot_written_elsewhere_finds_its_mesh_again(write_file, tmp_path):
    robot = read_robot(write_file(FOUR_BAR.replace(BEAM, mesh())))
    (tmp_path / "out").mkdir()
    write_robot(robot, tmp_path / "out" / "b.toml")
    again = read_robot(tmp_path / "out" / "b.toml").frame("coupler").link.surface
    assert again.resolve() == (tmp_path / "x.stl").resolve()


def test_a_relative_path_is_written_as_it_leads_from_the_new_file(
    write_file, tmp_path, monkeypatch
):
    """Read from where the file lies, written one folder further down."""
    write_file(FOUR_BAR.replace(BEAM, mesh()))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    write_robot(read_robot("robot.toml"), "out/b.toml")
    assert 'surface = "../x.stl"' in (tmp_path / "out/b.toml").read_text()


@pytest.mark.parametrize("text", [FOUR_BAR, SLIDER], ids=["four_bar", "slider"])
def test_what_is_written_reads_as_the_same_robot(text, write_file, tmp_path):
    robot = read_robot(write_file(text))
    write_robot(robot, tmp_path / "again.toml")
    assert_same_robot(read_robot(tmp_path / "again.toml"), robot)


def test_the_reference_robot_loads_and_closes():
    path = Path(__file__).parents[4] / "shared" / "reference" / "irsbot2.toml"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    robot = read_robot(path)
    assert len(robot.frames) == 42
    assert home_posture(robot).mismatch < 1e-14


def assert_same_robot(robot, expected):
    """Every field, to the last bit."""
    for key in ("name", "platform", "closures", "description"):
        assert getattr(robot, key) == getattr(expected, key)
    assert len(robot.frames) == len(expected.frames)
    for a, b in zip(robot.frames, expected.frames, strict=True):
        for key, value in vars(b).items():
            here = getattr(a, key)
            if isinstance(value, MatrixLink):
                here, value = here.stiffness, value.stiffness
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(here, value)
            else:
                assert here == value, key


# numbers of machines, with all their digits
lengths = st.floats(-10, 10).filter(lambda x: x == 0 or abs(x) > 1e-6)
positive = st.floats(1e-6, 1e12)
vectors = st.tuples(lengths, lengths, lengths)
sixes = st.lists(lengths, min_size=6, max_size=6)
names = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=9)
material = {
    "young": positive,
    "poisson": st.floats(-0.9, 0.49),
    "density": st.none() | positive,
}
sections = st.one_of(
    st.fixed_dictionaries({"radius": st.floats(0.1, 1)}),
    st.fixed_dictionaries({
        "radius": st.floats(0.1, 1), "inner_radius": st.floats(0, 0.09),
    }),
    st.fixed_dictionaries({"width": st.floats(0.1, 1), "height": st.floats(0.1, 1)}),
    st.fixed_dictionaries(
        dict.fromkeys(["area", "I_y", "I_z", "J", "shear_y", "shear_z"], positive)
    ),
)  # fmt: skip
diagonals = st.lists(positive, min_size=6, max_size=6)
interfaces = st.sampled_from([
    "z=0.452",
    {"plane": {"point": [0, 0, 1.5], "normal": [0, 0, 1]}, "radius": 0.1},
    {"bore": {"point": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.01}},
])
links = st.one_of(
    st.none(),
    st.builds(
        BeamLink, sections, **material, theory=st.sampled_from(["euler", "timoshenko"]),
        length=st.just(0.3), axis=st.just((1.0, 0.5, 0.0)),
        up=st.none() | st.just((0.0, 1.0, 2.0)),
    ),
    diagonals.map(lambda d: MatrixLink(np.diag(d))),
    st.builds(LibraryLink, st.just(Path("/a #b/c.nc")), st.sampled_from(["k", "ü"])),
    st.builds(
        MeshLink, st.just(Path("/meshes/ü.stl")), interfaces, interfaces, **material,
        unit=st.sampled_from(["m", "mm"]), up=st.just((1.0, 0.0, 0.0)),
        frame_up=st.just((0.0, 0.0, 1.0)),
        interface=st.sampled_from(["rigid", "distributing"]),
    ),
)  # fmt: skip


@st.composite
def robots(draw):
    """A serial arm of any joints and bodies, with a fixed platform at its end."""
    given = draw(st.lists(names, min_size=1, max_size=5, unique=True))
    given = [name for name in given if name != "base"] or ["tool"]
    frames = []
    for i, name in enumerate(given):
        joint = draw(st.sampled_from(["fixed", "revolute", "prismatic"]))
        joint = "fixed" if i == len(given) - 1 else joint
        bare = {"clearance": None, "joint_stiffness": None}
        moves = joint != "fixed"
        actuated = moves and draw(st.booleans())
        stiffness = st.none() | (diagonals | st.just([math.inf] * 6)).map(np.diag)
        K = draw(stiffness)
        own = 5 if joint == "prismatic" else 2
        if moves and not actuated and K is not None and np.isinf(K[own, own]):
            K[own, own] = 0.0  # free: a passive joint is not locked by its stiffness
        play = st.none() | st.floats(0, 1)
        kinds = bare if i == len(given) - 1 else {
            "clearance": draw(st.none() | st.builds(Clearance, play, play, play, play)),
            "joint_stiffness": K,
        }  # fmt: skip
        x, y, z = draw(vectors)
        frames.append(
            Frame(
                name=name,
                parent=given[i - 1] if i else "base",
                translation=np.array([x, y, z + 50.0]),  # never on the parent's origin
                rotation=np.array(draw(vectors)),
                joint=joint,
                actuated=actuated,
                position=0.0,
                geometric_error=np.array([*draw(vectors), *draw(vectors)]),
                limits=draw(st.none() | st.just((-1.5, 2.0))) if moves else None,
                tolerance=draw(st.none() | sixes.map(np.abs)),
                link=draw(links),
                mass=draw(st.just(0.0) | positive),
                centre_of_mass=np.array(draw(vectors)),
                **kinds,
            )
        )
    return Robot(draw(names), given[-1], tuple(frames), (), draw(st.text(max_size=9)))


@settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(robot=robots())
def test_any_robot_reads_back_as_it_was_written(robot, tmp_path):
    write_robot(robot, tmp_path / "robot.toml")
    assert_same_robot(read_robot(tmp_path / "robot.toml"), robot)


def test_the_documentations_example_loads_and_closes(write_file):
    text = (Path(__file__).parents[3] / "docs" / "robot_files.md").read_text("utf-8")
    robot = read_robot(write_file(text.split("```toml\n")[1].split("```")[0]))
    posture = home_posture(robot)
    assert posture.mismatch < 1e-9
    # both legs are mirror images, so they meet on the y axis
    assert posture.platform[0, 3] == pytest.approx(0.0, abs=1e-9)
    assert {f.joint for f in robot.frames} == {"fixed", "revolute"}


def test_the_documentations_bearing_turns_freely_and_yields_as_its_data_sheet_says(
    write_file,
):
    """Radial 1.2e8 N/m, axial 6e7 N/m: under 60 N the hub moves by F/k, worked by hand.

    Its play is taken up first; about its axis nothing resists.
    """
    text = (Path(__file__).parents[3] / "docs" / "robot_files.md").read_text("utf-8")
    example = text.split("```toml\n")[2].split("```")[0]
    alone = 'platform = "hub_flange"\n[[frame]]\nname = "hub_flange"\nparent = "hub"\n'
    robot = read_robot(write_file(alone + example.replace('"right.elbow"', '"base"')))
    hub = robot.frame("hub")
    assert not hub.compliant
    assert hub.own_stiffness == 0.0
    up = solve_assembly(home_posture(robot), [0, 0, 0, 60.0, 0, 0])
    assert up.platform_screw[3] == pytest.approx(5e-6 + 60 / 1.2e8, rel=1e-9)
    along = solve_assembly(home_posture(robot), [0, 0, 0, 0, 0, 60.0])
    assert along.platform_screw[5] == pytest.approx(8e-6 + 60 / 6e7, rel=1e-9)
    assert mobility(home_posture(robot)).locked_freedoms == 1
    with pytest.raises(FreeMotion):
        solve_assembly(home_posture(robot), [0, 0, 1.0, 0, 0, 0])


def test_a_dh_table_without_alpha_is_told(write_file, run, monkeypatch):
    """By solve, in text and JSON, and by show; with alpha nothing is said."""
    text = """
platform = "tool"
[[frame]]
name = "arm"
parent = "base"
dh = { a = 0.3 }
[[frame]]
name = "wrist"
parent = "arm"
dh = { a = 0.2, alpha = 0.0 }
[[frame]]
name = "tool"
parent = "wrist"
dh = { d = 0.1 }
"""
    told = 'dh without alpha, taken as 0: "arm", "tool"'
    file = write_file(text)
    assert read_robot(file).remarks == (told,)
    _, out, _ = run("assembly", "solve", file)
    assert f"\nnote: {told}\n" in out
    _, out, _ = run("assembly", "solve", file, "--json", "-")
    assert json.loads(out)["remarks"] == [told]

    class Plotter:
        def screenshot(self, *_, **__):
            return np.zeros((2, 2, 3), dtype=np.uint8)

        def close(self):
            pass

    monkeypatch.setattr("assembly.report.plot.draw_assembly", lambda *_: Plotter())
    status, out, _ = run("assembly", "show", file, "-o", file.with_suffix(".png"))
    assert (status, out) == (0, f"note: {told}\n")
    full = text.replace("a = 0.3", "a = 0.3, alpha = 0").replace(
        "d =", "alpha = 0, d ="
    )
    assert read_robot(write_file(full)).remarks == ()


def test_a_bearing_is_written_and_read_back(tmp_path):
    K = np.diag([2e4, 2e4, 0.0, 1.2e8, 1.2e8, 6e7])
    hub = Frame("hub", joint="revolute", joint_stiffness=K)
    robot = Robot("hub", "tool", (hub, Frame("tool", "hub")))
    write_robot(robot, tmp_path / "hub.toml")
    again = read_robot(tmp_path / "hub.toml").frame("hub")
    assert np.array_equal(again.joint_stiffness, K)
    with pytest.raises(BadInput, match="found inf along the own motion"):
        replace(hub, joint_stiffness=np.diag([1.0, 1.0, np.inf, 1.0, 1.0, 1.0]))
