"""Labelled arrays of stiffness, curves and modes, with the names used in sweep files.

========================  ======================================================
``compliance``            matrix C
``stiffness_matrix``      matrix K_C (for one posture)
``stiffness``             stiffness along each axis, with other motions free
``eigen_stiffness``       principal stiffnesses
``stiffness_condition``   ratio of largest to smallest principal stiffness
``share``                 compliance share of each component along each axis
``read_at``               reference point of all these quantities, base axes
========================  ======================================================
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.tables import labelled
from forcefit.results.quantities import Quantity, flag, number, text
from forcefit.stiffness.screws import SCREW, WRENCH

if TYPE_CHECKING:
    import xarray

    from forcefit.assembly.platform_stiffness.deflection import DeflectionCurve
    from forcefit.assembly.platform_stiffness.many_stiffnesses import Stiffnesses
    from forcefit.assembly.platform_stiffness.matrices import Part, PlatformStiffness
    from forcefit.assembly.platform_stiffness.vibration import NaturalModes

_EIGEN = tuple("123456")


def tangent_quantities(
    tangent: "PlatformStiffness", parts: "Sequence[Part]"
) -> dict[str, NDArray]:
    """Return arrays that describe the stiffness at one posture.

    Args:
        tangent: stiffness at one posture.
        parts: m links and joints whose shares are returned.

    Returns:
        ``compliance`` (6, 6), ``stiffness`` (6,), ``eigen_stiffness`` (6,),
        ``stiffness_condition`` () and ``share`` (m, 6).
    """
    eigen = tangent.eigen
    shares: list[Mapping[Part, float]] = [tangent.shares(axis) for axis in np.eye(6)]
    return {
        "compliance": tangent.compliance,
        "stiffness": np.array([tangent.along(axis)[0] for axis in np.eye(6)]),
        "eigen_stiffness": eigen.values,
        "stiffness_condition": np.array(eigen.condition),
        "share": np.array([[one.get(part, 0.0) for one in shares] for part in parts]),
    }


def many_quantities(many: "Stiffnesses") -> dict[str, NDArray]:
    """Return the arrays of :func:`tangent_quantities` for k postures."""
    by_axis = [list(many.shares(axis).values()) for axis in np.eye(6)]
    return {
        "compliance": many.compliance,
        "stiffness": np.stack([many.along(axis) for axis in np.eye(6)], axis=1),
        "eigen_stiffness": many.eigen_stiffnesses,
        "stiffness_condition": many.condition,
        "share": np.array(by_axis).transpose(2, 1, 0),
    }


def stiffness_dataset(tangent: "PlatformStiffness") -> "xarray.Dataset":
    """Return a data set of the stiffness at one posture."""
    parts = list(dict.fromkeys([*tangent.parts, *tangent.shares(np.eye(6)[0])]))
    values = tangent_quantities(tangent, parts)
    values |= {"stiffness_matrix": tangent.stiffness, "read_at": tangent.point}
    labels = {"eigen": _EIGEN, "part": [part.words for part in parts]}
    data = labelled(values, labels=labels)
    robot = tangent.posture.robot.name
    return data.assign_attrs(robot=robot, state=tangent.state)


def stiffnesses_dataset(many: "Stiffnesses") -> "xarray.Dataset":
    """Return a data set of the stiffness at many postures."""
    parts = [part.words for part in many.shares(np.eye(6)[0])]
    labels = {"eigen": _EIGEN, "part": parts}
    values = many_quantities(many) | {"read_at": many.point}
    data = labelled(values, "point", np.arange(len(many)), labels)
    robot = many.posture.robot.name
    return data.assign_attrs(robot=robot, state=many.state)


def modes_dataset(modes: "NaturalModes") -> "xarray.Dataset":
    """Return a data set of natural modes."""
    parts = sorted({part for shares in modes.shares for part in shares})
    shares = [[one.get(part, 0.0) for part in parts] for one in modes.shares]
    count = len(modes.frequencies)
    motion = Quantity(
        "platform's motion", "rad, m", ("screw",), "of a mode, with modal mass 1 kg"
    )
    share = Quantity(
        "share of a part", dims=("part",), meaning="in the elastic energy of a mode"
    )
    values = {
        "frequency": (number("natural frequency", "Hz"), modes.frequencies),
        "platform_screw": (motion, modes.platform_screws.T),
        "share": (share, np.reshape(shares, (count, len(parts)))),
    }
    labels = {"part": [part.words for part in parts]}
    data = labelled(values, "mode", np.arange(1, count + 1), labels)
    return data.assign_attrs(robot=modes.posture.robot.name)


def curve_dataset(curve: "DeflectionCurve") -> "xarray.Dataset":
    """Return a data set of a load-deflection curve."""
    turns = curve.component < 3
    load, deflection = ("N m", "rad") if turns else ("N", "m")
    pressed = [", ".join(sorted(names)) for names in curve.pressed]
    values = {
        "load": (number(f"{WRENCH[curve.component]} of the load", load), curve.loads),
        "deflection": (
            number(f"{SCREW[curve.component]} of the platform", deflection),
            curve.deflection,
        ),
        "platform_screw": curve.screws,
        "energy": curve.energies,
        "stiffness": (
            number("tangent stiffness", f"{load}/{deflection}"), curve.stiffness
        ),
        "contacts": (text("closed clearances"), np.array(pressed, dtype=object)),
        "free_in_clearances": (flag("free within clearances"), curve.open_),
    }  # fmt: skip
    data = labelled(values, "point", np.arange(len(curve.loads)))
    return data.assign_attrs(robot=curve.posture.robot.name)
