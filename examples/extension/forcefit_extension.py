"""Example package that extends forcefit by a reader, an effect and a link model.

``pip install ./examples/extension`` installs it.  docs/extensions.md describes the
requirements on the three objects.
"""

from math import pi
from pathlib import Path

import numpy as np

import forcefit as ff
from forcefit.assembly.effects.effect import Effect, Unknown
from forcefit.assembly.effects.places import drives, with_screws
from forcefit.assembly.model.links import own_screw
from forcefit.stiffness.screws import screw_map


def read_chain(path):
    """Return a planar arm from a file with the lengths of its links [m]."""
    lengths = [float(word) for word in Path(path).read_text(encoding="utf-8").split()]
    if not lengths:
        raise ff.BadInput(f"{path}: found no lengths, expected one for each link")
    frames = [ff.Frame("joint1", joint="revolute", actuated=True)]
    for number, length in enumerate(lengths[:-1], 2):
        parent = frames[-1].name
        frames.append(
            ff.Frame(
                f"joint{number}", parent, translation=[length, 0, 0],
                joint="revolute", actuated=True,
            )
        )  # fmt: skip
    frames.append(ff.Frame("tip", frames[-1].name, translation=[lengths[-1], 0, 0]))
    return ff.Robot("chain", "tip", tuple(frames))


def _with_gains(conditions, gains):
    """Return conditions in which each drive moves by (1 + gain) times its command."""
    for name, gain in gains.items():
        row = conditions.robot.index(name)
        more = gain * conditions.coordinates[:, row]  # [rad or m] for each measurement
        screws = more[:, None] * own_screw(conditions.robot.frames[row])
        conditions = with_screws(conditions, name, screws)
    return conditions


DRIVE_GAIN = Effect(
    name="drive_gain",
    apply=_with_gains,
    unit=lambda robot, parameter: "1",
    frames=drives,
    components=("",),
    unknowns=lambda robot: (Unknown("", scale=1e-4),),
    by_row=True,
)


def cone(span, values):
    """Return K_E of a solid cone along the span, by Euler-Bernoulli theory.

    Args:
        span: (3,) [m] vector from the start of the link to its end, in the axes of
            the frame.
        values: ``start_radius`` and ``end_radius`` [m], ``young`` [Pa], ``poisson``.

    Returns:
        (6, 6) [N m/rad .. N/m] stiffness at the end of the link, in the axes of the
        frame.
    """
    length = float(np.linalg.norm(span))
    R, r = float(values["start_radius"]), float(values["end_radius"])
    E, G = values["young"], values["young"] / (2 * (1 + values["poisson"]))
    along = np.asarray(span) / length
    axial = np.outer(along, along)
    compliance = np.zeros((6, 6))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    for node, weight in zip(nodes, weights, strict=True):
        s = (node + 1) / 2  # position along the cone, from 0 at the start to 1
        radius = R + (r - R) * s
        area, second = pi * radius**2, pi * radius**4 / 4
        slice_ = np.zeros((6, 6))  # compliance per unit length
        slice_[:3, :3] = axial / (2 * G * second) + (np.eye(3) - axial) / (E * second)
        slice_[3:, 3:] = axial / (E * area)
        to_end = screw_map((s - 1) * np.asarray(span))
        compliance += weight / 2 * length * to_end @ slice_ @ to_end.T
    return np.linalg.inv(compliance)
