"""Masses and moments of inertia of MJCF bodies, explicit or computed from shapes.

Sources:
    MuJoCo documentation, XML reference, compiler (``inertiafromgeom``,
    ``inertiagrouprange``, ``boundmass``, ``boundinertia``, ``balanceinertia``,
    ``settotalmass``), inertial (``diaginertia``, ``fullinertia``) and geom (sizes,
    ``fromto``, ``mass``, ``density``, ``shellinertia``). The area of an ellipsoid is
    computed by Thomsen's formula, as in MuJoCo.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import WORLD, Body
from forcefit.assembly.exchange.mjcf_orientation import Angles, orientation
from forcefit.assembly.exchange.shapes import area, moments, shell_moments, volume
from forcefit.assembly.exchange.xml_file import Node
from forcefit.assembly.model.inertia import (
    MassProperties,
    inertia_matrix,
    joined_bodies,
)

_SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
# [kg, kg m^2] smaller lower bounds are ignored, because their only purpose is that
# MuJoCo accepts massless bodies
_REGULAR, _REGULAR_INERTIA = 1e-6, 1e-9
_KINDS = (*_SIZES, "plane", "hfield", "mesh", "sdf")


@dataclass(frozen=True, eq=False)
class MassRules:
    """Rules for masses in the compiler element of a file.

    Attributes:
        from_shapes: whether masses are computed from shapes: ``true``, ``false``, or
            ``auto`` for bodies without an explicit mass.
        groups: smallest and largest group number of the shapes that have a mass.
        least: lower bound of the mass of each body [kg].
        total: total mass to which all masses are scaled [kg]; not used if <= 0.
        least_inertia: lower bound of the principal moments of inertia [kg m^2].
        balanced: whether impossible moments of inertia are replaced by their mean.
    """

    from_shapes: str = "auto"
    groups: tuple[float, float] = (0.0, 5.0)
    least: float = 0.0
    total: float = -1.0
    least_inertia: float = 0.0
    balanced: bool = False

    @staticmethod
    def of(root: Node) -> "MassRules":
        """Return the rules from the compiler elements of a file.

        If several elements define the same rule, the last one applies.
        """
        rules = MassRules()
        for node in root.children("compiler"):
            groups = node.numbers(
                "inertiagrouprange", 2, "group", np.array(rules.groups)
            )
            rules = MassRules(
                node.choice(
                    "inertiafromgeom", ("false", "true", "auto"), rules.from_shapes
                ),
                (float(groups[0]), float(groups[1])),
                node.number("boundmass", "kg", rules.least),
                node.number("settotalmass", "kg", rules.total),
                node.number("boundinertia", "kg m^2", rules.least_inertia),
                node.choice(
                    "balanceinertia", ("false", "true"), str(rules.balanced).lower()
                )
                == "true",
            )
        return rules

    def applied(self, bodies: Mapping[str, Body]) -> dict[str, Body]:
        """Apply the lower bounds and the total mass to the bodies of a file."""
        bounded = {
            name: self._bounded(body) if name != WORLD else body
            for name, body in bodies.items()
        }  # fmt: skip
        total = sum(body.mass for body in bounded.values())
        if self.total <= 0 or not total:
            return bounded
        factor = self.total / total
        return {
            name: replace(body, mass=body.mass * factor, inertia=body.inertia * factor)
            for name, body in bounded.items()
        }

    def _bounded(self, body: Body) -> Body:
        """Increase the mass and principal moments of a body to the lower bounds."""
        if self.least > _REGULAR:
            body = replace(body, mass=max(body.mass, self.least))
        if not self.balanced and self.least_inertia <= _REGULAR_INERTIA:
            return body
        principal, R = np.linalg.eigh(body.inertia)
        if self.least_inertia > _REGULAR_INERTIA:
            principal = np.maximum(principal, self.least_inertia)
        if self.balanced and principal[2] > principal[0] + principal[1]:
            principal[:] = principal.mean()
        return replace(body, inertia=R @ np.diag(principal) @ R.T)


def written_mass(inertial: Node, offset: NDArray, angles: Angles) -> MassProperties:
    """Return the mass properties of an ``inertial`` element in body axes.

    Args:
        inertial: the element.
        offset: pose of the element's frame relative to the body, (4, 4).
        angles: angle conventions of the file.

    Returns:
        Mass, centre of mass and inertia matrix, which is zero by default.

    Raises:
        BadInput: the mass is negative, or a number is invalid.
    """
    mass = inertial.number("mass", "kg")
    if mass < 0:
        raise inertial.bad("mass", f"found {mass:g}, expected >= 0 [kg]")
    centre = inertial.numbers("pos", 3, "m", np.zeros(3))
    six = np.zeros(6)
    if inertial.has("fullinertia"):
        six = inertial.numbers("fullinertia", 6, "kg m^2")
    elif inertial.has("diaginertia"):
        six[:3] = inertial.numbers("diaginertia", 3, "kg m^2")
    R = offset[:3, :3] @ orientation(inertial, angles)
    J = R @ inertia_matrix(six) @ R.T
    return mass, offset[:3, :3] @ centre + offset[:3, 3], J


def shape_mass(geom: Node, T: NDArray, rules: MassRules) -> MassProperties | None:
    """Return the mass properties of a shape.

    Args:
        geom: element with its default attributes.
        T: pose of the shape relative to its body, (4, 4).
        rules: mass rules of the file.

    Returns:
        Mass, centre of mass and inertia matrix; None for a mesh, unless its mass is 0.

    Raises:
        BadInput: a size or mass is invalid.
    """
    nothing = 0.0, T[:3, 3], np.zeros((3, 3))
    kind = geom.choice("type", _KINDS, "sphere")
    group = geom.number("group", "-", 0.0)
    if kind == "plane" or not rules.groups[0] <= group <= rules.groups[1]:
        return nothing
    given = geom.number("mass", "kg") if geom.has("mass") else None
    if given is not None and given < 0:
        raise geom.bad("mass", f"found {given:g}, expected >= 0 [kg]")
    # the attribute ``mesh`` means that MuJoCo fits the shape to a mesh
    if kind not in _SIZES or geom.has("mesh"):
        return nothing if given == 0.0 else None
    density, sizes = geom.number("density", "kg/m^3", 1000.0), _sizes(geom, kind)
    if geom.optional("shellinertia") == "true":
        skin = _thomsen(sizes) if kind == "ellipsoid" else area(kind, sizes)
        mass, principal = density * skin, shell_moments(kind, sizes)
    else:
        mass, principal = density * volume(kind, sizes), moments(kind, sizes)
    mass = mass if given is None else given
    return mass, T[:3, 3], mass * T[:3, :3] @ np.diag(principal) @ T[:3, :3].T


def _sizes(geom: Node, kind: str) -> list[float]:
    """Return the dimensions of a shape [m]: radii, half axes, lengths or edges."""
    given = geom.optional("size").split()
    count = _SIZES[kind]
    if geom.has("fromto"):
        ends = geom.numbers("fromto", 6, "m")
        half = float(np.linalg.norm(ends[3:] - ends[:3])) / 2
        radius = _first(geom, len(given))
        sizes = [radius, half] if count == 2 else [radius, radius, half]
    else:
        # the format permits more numbers than the shape requires
        sizes = geom.numbers("size", max(count, len(given)), "m").tolist()[:count]
    if min(sizes) <= 0:
        raise geom.bad("size", f"found {min(sizes):g}, expected > 0 [m]")
    if kind == "box":
        return [2 * size for size in sizes]
    return [sizes[0], 2 * sizes[1]] if count == 2 else sizes


def _first(geom: Node, count: int) -> float:
    """Return the first number of the attribute ``size`` [m]."""
    return float(geom.numbers("size", max(1, count), "m")[0])


def _thomsen(half_axes: list[float]) -> float:
    """Return the surface area of an ellipsoid [m^2], accurate to about 1 %."""
    a, b, c = (x**1.6075 for x in half_axes)
    return 4 * math.pi * ((a * b + b * c + c * a) / 3) ** (1 / 1.6075)


def body_of(
    name: str, written: MassProperties | None, shapes: list[MassProperties],
    rules: MassRules,
) -> Body:  # fmt: skip
    """Return a body from its explicit mass and its shapes.

    Args:
        name: name of the body.
        written: mass properties from ``inertial``; None without this element.
        shapes: mass properties of each shape.
        rules: mass rules of the file.

    Returns:
        The body with its mass properties.
    """
    use_shapes = rules.from_shapes == "true" and bool(shapes)
    if written is not None and not use_shapes:
        return Body(name, *written)
    if rules.from_shapes == "false" or not shapes:
        return Body(name)
    return Body(name, *joined_bodies(shapes))
