"""Reading and writing of elastic links in robot files."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.files.joint_file import definite
from forcefit.assembly.files.link_models import model_link
from forcefit.assembly.model.largest import LARGEST, LARGEST_LENGTH
from forcefit.assembly.model.robot import (
    BeamLink,
    LibraryLink,
    Link,
    MatrixLink,
    MeshLink,
)
from forcefit.inputs.table import Table, describe, quoted
from forcefit.inputs.writing import path_from
from forcefit.stiffness.surface.surface import UNITS

_SMALLEST_LENGTH = 1e-12  # [m] smallest accepted length
# maximum number of springs in series that represent a beam
_MOST_PIECES = 100
_ONE_SECTION = (
    '"radius" [, "inner_radius"] or "width", "height" or '
    '"area", "I_y", "I_z", "J", "shear_y", "shear_z"'
)
_KINDS = ("beam", "stiffness", "mesh", "library", "model")
_MATERIAL = ("young", "poisson", "density")
# keys and units, by type of cross section
_SECTIONS: dict[str, dict[str, str]] = {
    "round": {"radius": "m", "inner_radius": "m"},
    "rectangular": {"width": "m", "height": "m"},
    "general": {
        "area": "m^2", "I_y": "m^4", "I_z": "m^4", "J": "m^4",
        "shear_y": "-", "shear_z": "-",
    },
}  # fmt: skip


def read_link(frame: Table, span: NDArray) -> Link | None:
    """Read the link of a ``[[frame]]`` table.

    Args:
        frame: table of the frame, whose keys ``link`` and ``up`` are read.
        span: vector from the parent origin to the frame origin in frame axes, (3,) [m],
            for link models from other distributions.

    Returns:
        Link, or None if the body is rigid.

    Raises:
        BadInput: the table is invalid.
    """
    if not frame.has("link"):
        return None
    link = frame.table("link")
    kinds = [kind for kind in _KINDS if link.has(kind)]
    if not kinds and not set(link.content) <= {*_MATERIAL, "up", "pieces"}:
        link.finish()  # reports a misspelt key and suggests a valid one
    if len(kinds) != 1:
        given = " and ".join(map(quoted, kinds)) or "no type of link"
        names = " | ".join(map(quoted, _KINDS))
        raise link.bad("", f"found {given}, expected exactly one of {names}")
    result: Link
    if kinds == ["beam"]:
        result = _beam_link(link)
    elif kinds == ["stiffness"]:
        K = link.array("stiffness", (6, 6), "N m/rad .. N/m")
        result = MatrixLink(definite(link, "stiffness", K))
    elif kinds == ["mesh"]:
        result = _mesh_link(link, frame)
    elif kinds == ["model"]:
        result = model_link(link, span)
    else:
        result = _library_link(link)
    link.finish()
    return result


def _beam_link(link: Table) -> BeamLink:
    """Read ``beam = { ... }`` and the material."""
    beam = link.table("beam")
    theory = beam.choice("theory", ("timoshenko", "euler"), "timoshenko")
    length = _size(beam, "length", "m") if beam.has("length") else None
    axis = _direction(beam, "axis")
    if (length is None) != (axis is None):
        missing = "length" if length is None else "axis"
        raise beam.bad(missing, 'missing; expected "length" and "axis", or neither')
    up = _direction(beam, "up")
    section = _section(beam)
    beam.finish()
    return BeamLink(
        section, **_material(link), theory=theory, length=length, axis=axis, up=up,
        pieces=_pieces(link),
    )  # fmt: skip


def _pieces(link: Table) -> int:
    """Return the number of springs in series that represent a beam."""
    count = link.number("pieces", "-", 1.0, least=1.0, below=_MOST_PIECES + 1.0)
    if count != round(count):
        raise link.bad("pieces", f"found {count:g}, expected a whole number")
    return round(count)


def _section(beam: Table) -> dict[str, float]:
    """Return the dimensions of the cross section of a beam."""
    keys_of_kind = {
        kind: [key for key in keys if beam.has(key)] for kind, keys in _SECTIONS.items()
    }
    kinds = [kind for kind, keys in keys_of_kind.items() if keys]
    if len(kinds) != 1:
        if not kinds:
            beam.finish()  # reports a misspelt key and suggests a valid one
        names = (
            " and ".join(quoted(keys_of_kind[kind][0]) for kind in kinds)
            or "no section"
        )
        raise beam.bad("", f"found {names}, expected one section: {_ONE_SECTION}")
    units = dict(_SECTIONS[kinds[0]])
    inner = units.pop("inner_radius", None)
    section = {key: _size(beam, key, unit) for key, unit in units.items()}
    if inner is not None and beam.has("inner_radius"):
        section["inner_radius"] = beam.number(
            "inner_radius", inner, least=0.0, below=section["radius"]
        )
    return section


def _mesh_link(link: Table, frame: Table) -> MeshLink:
    """Read ``mesh = { surface, base, tip, ... }`` and the material."""
    from forcefit.stiffness.fem.part_text import read_parts

    mesh = link.table("mesh")
    ends = {key: _interface(mesh, key) for key in ("base", "tip")}
    up = _direction(mesh, "up")
    spelt = [table for table in (frame, link) if table.has("up")]
    frame_up = _direction(spelt[0], "up") if spelt else None
    if len(spelt) == 2:
        raise link.bad(
            "up",
            'found "up" in the frame and in its link; expected only one of the two',
        )
    if (up is None) != (frame_up is None):
        message = 'missing; expected the "up" of the mesh and of the frame, or neither'
        raise (mesh if up is None else frame).bad("up", message)
    result = MeshLink(
        surface=_path(mesh, "surface", mesh.text("surface")),
        **ends,
        **_material(link),
        unit=mesh.choice("unit", UNITS, "m"),
        up=up,
        frame_up=frame_up,
        axis=_direction(mesh, "axis"),
        interface=mesh.choice("interface", ("rigid", "distributing"), "rigid"),
        parts=read_parts(link),
    )
    mesh.finish()
    return result


def _interface(mesh: Table, key: str) -> Any:
    """Check the syntax of a mesh interface and return its text or table."""
    from forcefit.stiffness.surface.interface import parse_interface

    value = mesh.require(key, 'an interface such as "z=0.452"')
    if isinstance(value, dict):
        _check_interface_table(mesh.table(key))
    parse_interface(value, f"{mesh.file}: {mesh.place}.{key}")
    return value


def _check_interface_table(table: Table) -> None:
    """Check ``{ plane = { point, normal }, radius }`` or ``{ bore = { ... } }``."""
    kind, direction = ("bore", "axis") if table.has("bore") else ("plane", "normal")
    inner = table.table(kind)
    inner.array("point", (3,), "m", largest=LARGEST_LENGTH)
    inner.require(direction, "3 finite numbers [direction]")
    _direction(inner, direction)
    outer = inner if kind == "bore" else table
    if kind == "bore" or table.has("radius"):
        _size(outer, "radius", "m")
    inner.finish()
    table.finish()


def _library_link(link: Table) -> LibraryLink:
    """Read ``library = "path/to/library#key"``."""
    value = link.text("library")
    path, _, key = value.rpartition("#")
    if not (path and key):
        fault = f'found {describe(value)}, expected "path/to/library#key"'
        raise link.bad("library", fault)
    return LibraryLink(_path(link, "library", path), key)


def _material(link: Table) -> dict[str, Any]:
    """Return Young's modulus, Poisson's ratio, and the density, which may be None."""
    return {
        "young": _size(link, "young", "Pa"),
        "poisson": link.number("poisson", "-", above=-1.0, below=0.5),
        "density": _size(link, "density", "kg/m^3") if link.has("density") else None,
    }


def _size(table: Table, key: str, unit: str) -> float:
    """Return a positive number within limits."""
    length = unit == "m"
    largest = LARGEST_LENGTH if length else LARGEST
    smallest = _SMALLEST_LENGTH if length else 1 / LARGEST
    value = table.number(key, unit, above=0.0, largest=largest)
    if value < smallest:
        expected = f"expected at least {smallest:g} [{unit}]"
        raise table.bad(key, f"found {value:g}, {expected}")
    return value


def _direction(table: Table, key: str) -> tuple[float, float, float] | None:
    """Return a direction vector, or None if the key is absent."""
    if not table.has(key):
        return None
    vector = table.array(key, (3,), "direction", largest=LARGEST_LENGTH)
    if np.linalg.norm(vector) < _SMALLEST_LENGTH:
        raise table.bad(
            key,
            f"found {describe(vector.tolist())}, expected a nonzero direction vector",
        )
    x, y, z = vector.tolist()
    return x, y, z


def _path(table: Table, key: str, path: str) -> Path:
    """Resolve a path relative to the folder of the robot file."""
    if path.strip() in {"", ".", ".."}:
        raise table.bad(key, f"found {describe(path)}, expected the path of a file")
    return Path(table.file).parent / path


def link_table(link: Link, folder: Path | None = None) -> dict[str, Any]:
    """Return the keys of a ``[[frame]]`` table that describe a link.

    Args:
        link: link of a robot.
        folder: folder of the output file, to which paths are made relative; if None,
            paths are not changed.

    Returns:
        The keys ``link`` and, for some meshes, ``up``.
    """
    if isinstance(link, MatrixLink):
        return {"link": {"stiffness": link.stiffness.tolist()}}
    if isinstance(link, LibraryLink):
        return {"link": {"library": f"{_from(folder, link.library)}#{link.key}"}}
    names: tuple[str, ...] = ("theory", "length", "axis", "up")
    if isinstance(link, BeamLink):
        kind, inner = "beam", dict[str, Any](link.section)
    else:
        names = ("base", "tip", "unit", "axis", "up", "interface")
        kind, inner = "mesh", {"surface": _from(folder, link.surface)}
    given = {name: getattr(link, name) for name in names}
    for name, value in given.items():
        if value is not None:
            inner[name] = list(value) if isinstance(value, tuple) else value
    table = {kind: inner} | {name: getattr(link, name) for name in _MATERIAL}
    table = {key: value for key, value in table.items() if value is not None}
    if isinstance(link, BeamLink) and link.pieces > 1:
        table["pieces"] = link.pieces
    if isinstance(link, MeshLink) and link.parts:
        table["parts"] = list(link.parts)
    up = link.frame_up if isinstance(link, MeshLink) else None
    return {"link": table} if up is None else {"link": table, "up": list(up)}


def _from(folder: Path | None, path: Path) -> str:
    """Return a path relative to the folder of the output file."""
    if folder is None or path.is_absolute():
        return str(path)
    return path_from(folder.resolve(), path.resolve())
