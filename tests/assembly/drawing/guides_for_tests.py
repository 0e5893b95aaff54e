"""Robots with guides and pads, and the inequalities of their clearances."""

import itertools

import numpy as np
from scipy.optimize import linprog

from forcefit.assembly.files.robot_file import read_robot
from forcefit.stiffness.screws import skew

C, L, W, T = 1e-5, 0.08, 0.04, 0.03  # [m] gap, length, width and height of the guide
GUIDE = "guide = { gap = 1e-5, length = 0.08, width = 0.04, height = 0.03 }"
PAD = "pad = { gap = 1e-5, length = 0.06, width = 0.04 }"
G_PAD, A, B = 1e-5, 0.03, 0.02  # [m] gap, half the length and half the width of the pad
SIGNS = list(itertools.product((1, -1), (1, -1)))


def guide_slabs(gaps=(C, C)):
    """Return a matrix (8, 6) with |matrix @ screw| <= 1 for screws of a guide."""
    rows = [np.array([0, s * L / 2, r * T / 2, 1, 0, 0]) / gaps[0] for s, r in SIGNS]
    rows += [np.array([s * L / 2, 0, r * W / 2, 0, 1, 0]) / gaps[1] for s, r in SIGNS]
    return np.array(rows)


def pad_slabs():
    """Return a matrix (4, 6) with |matrix @ screw| <= 1 for screws of a pad."""
    return np.array([[s * B, r * A, 0, 0, 0, 1] for s, r in SIGNS]) / G_PAD


def support(direction, slabs, equal=None):
    """Maximise direction @ screw subject to |slabs @ screw| <= 1."""
    both = np.vstack([slabs, -slabs])
    zero = None if equal is None else np.zeros(len(equal))
    scale = np.array([1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5])
    size = np.abs(direction * scale).max()
    found = linprog(
        -direction * scale / size, both * scale, np.ones(len(both)),
        None if equal is None else equal * scale / 1e-5, zero, bounds=(None, None),
    )  # fmt: skip
    assert found.success, found.message
    return -found.fun * size


def at(point):
    """Return the transformation of a screw from a point to the origin, (6, 6)."""
    shift = np.eye(6)
    shift[3:, :3] = skew(np.array(point, dtype=float))
    return shift


def drawn_in(folder, *tables):
    """Read a robot with the platform "table" from tables of bodies and joints."""
    file = folder / "drawn.toml"
    head = 'format = 2\nplatform = "table"\nplatform_at = [0, 0, 0]\n'
    file.write_text(head + "\n".join(tables))
    return read_robot(file)


def body(name):
    return f'[[body]]\nname = "{name}"\n'


def joint(name, kind, first, second, *keys, at=(0, 0, 0)):
    given = "\n".join(keys)
    return f"""
        [[joint]]
        name = "{name}"
        type = "{kind}"
        between = ["{first}", "{second}"]
        at = {[float(x) for x in at]}
        {given}
    """


Z = "axis = [0, 0, 1]"
