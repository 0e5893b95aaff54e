"""Masses and moments of inertia of SDF links.

Sources:
    sdformat.org, specification 1.12, ``<inertial>``.  The default mass is 1 kg, and the
    default moments of inertia are 1 kg m^2.  With ``auto``, they are computed from the
    collision shapes with a default density of 1000 kg/m^3.  If the element contains a
    mass, the computed moments are scaled to this mass.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import Body
from forcefit.assembly.exchange.sdf_frames import Frames, Named, own_pose
from forcefit.assembly.exchange.shapes import moments, volume
from forcefit.assembly.exchange.xml_file import Node
from forcefit.assembly.model.inertia import (
    MassProperties,
    inertia_matrix,
    joined_bodies,
)

_DEFAULT_MASS = 1.0  # [kg] default value of the format
_DEFAULT_INERTIA = np.eye(3)  # [kg m^2] default value of the format
_DEFAULT_DENSITY = 1000.0  # [kg/m^3] default value of the format
# elements that contain the dimensions of a shape, and their number of values
_SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "ellipsoid": {"radii": 3},
          "cylinder": {"radius": 1, "length": 1},
          "capsule": {"radius": 1, "length": 1},
          "cone": {"radius": 1, "length": 1}}  # fmt: skip


def link_body(frames: Frames, name: str, named: Named) -> tuple[Body, str]:
    """Return the body of a link, and a description of assumptions on its mass.

    Args:
        frames: frames of the model.
        name: name of the link.
        named: element of the link.

    Returns:
        The body, and the assumptions, which are empty if the file contains its mass and
        moments of inertia.

    Raises:
        BadInput: a mass or a size is not positive.
    """
    node = named.node
    inertial = node.child("inertial")
    if inertial is None:
        words = "no inertial: 1 kg and 1 kg m^2, the format's defaults"
        return Body(name, _DEFAULT_MASS, inertia=_DEFAULT_INERTIA), words
    mass, pose = inertial.child("mass"), inertial.child("pose")
    kilograms = None if mass is None else mass.number("", "kg")
    if kilograms is not None and kilograms < 0:
        raise node.bad("inertial.mass", f"found {kilograms:g}, expected >= 0 [kg]")
    if inertial.optional("auto") in {"true", "1"}:
        made, centre, J = _of_shapes(frames, named, inertial)
        if made and kilograms is None:
            return Body(name, made, centre, J), "made of its shapes (auto)"
        if made and kilograms is not None:
            return Body(name, kilograms, centre, kilograms / made * J), ""
    T, written = np.eye(4) if pose is None else own_pose(pose), _moments(inertial)
    words = "no mass: 1 kg, the format's default" if kilograms is None else ""
    J = _DEFAULT_INERTIA if written is None else written
    if written is None:
        lack = "no moments of inertia: 1 kg m^2"
        words = f"{words}; {lack}" if words else f"{lack}, the format's default"
    kilograms = _DEFAULT_MASS if kilograms is None else kilograms
    return Body(name, kilograms, T[:3, 3], T[:3, :3] @ J @ T[:3, :3].T), words


def _moments(inertial: Node) -> NDArray | None:
    """Return the inertia matrix in an element, (3, 3) [kg m^2], or None."""
    inertia = inertial.child("inertia")
    if inertia is None:
        return None
    six = []
    for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        inner = inertia.child(key)
        default = 1.0 if key[1] == key[2] else 0.0
        six.append(default if inner is None else inner.number("", "kg m^2"))
    return inertia_matrix(six)


def _of_shapes(frames: Frames, named: Named, inertial: Node) -> MassProperties:
    """Return the combined mass properties of the collision shapes of a link."""
    density = _density(inertial, _DEFAULT_DENSITY)
    parts = []
    for collision in named.node.children("collision"):
        geometry = collision.child("geometry")
        shape = None if geometry is None else next(geometry.children(), None)
        if shape is None or shape.tag not in _SIZES:
            what = "no shape" if shape is None else shape.tag
            raise collision.bad(
                "geometry", f"found {what}, for which forcefit computes no automatic "
                f"inertia; expected {' | '.join(_SIZES)}, or a mass written in "
                "the file"
            )  # fmt: skip
        T = _placed(frames, named, collision)
        sizes = _sizes(shape)
        # a cone's centre of mass is at a quarter of its length from its base
        above = -sizes[1] / 4 if shape.tag == "cone" else 0.0
        centre = T[:3, :3] @ [0.0, 0.0, above] + T[:3, 3]
        mass = _density(collision, density) * volume(shape.tag, sizes)
        J = mass * T[:3, :3] @ np.diag(moments(shape.tag, sizes)) @ T[:3, :3].T
        parts.append((mass, centre, J))
    return joined_bodies(parts)


def _sizes(shape: Node) -> list[float]:
    """Return the dimensions of a shape [m], which must be positive."""
    sizes: list[float] = []
    for key, count in _SIZES[shape.tag].items():
        inner = shape.child(key)
        if inner is None:
            raise shape.bad(key, "missing; expected its size [m]")
        sizes += inner.numbers("", count, "m").tolist()
    if min(sizes) <= 0:
        raise shape.bad("", f"found the size {min(sizes):g}, expected > 0 [m]")
    return sizes


def _density(node: Node, default: float) -> float:
    """Return the density in an element [kg/m^3], or a default value."""
    inner = node.child("density")
    if inner is None:
        return default
    density = inner.number("", "kg/m^3")
    if density <= 0:
        raise node.bad("density", f"found {density:g}, expected > 0 [kg/m^3]")
    return density


def _placed(frames: Frames, named: Named, collision: Node) -> NDArray:
    """Return the pose of a collision shape relative to its link, (4, 4)."""
    pose = collision.child("pose")
    if pose is None:
        return np.eye(4)
    relative = pose.optional("relative_to") or pose.optional("frame")
    if not relative:
        return own_pose(pose)
    link = frames.name(named.node.text("name"), named.scope, named.node)
    seen_from = frames.pose(frames.name(relative, named.scope, pose))
    return np.asarray(np.linalg.inv(frames.pose(link)) @ seen_from @ own_pose(pose))
