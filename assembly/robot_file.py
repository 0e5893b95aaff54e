"""Robot files in and out (``docs/robot_files.md``), every rule checked at the door."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.robot import (
    BASE,
    JOINTS,
    BeamLink,
    Clearance,
    Frame,
    LibraryLink,
    Link,
    MatrixLink,
    MeshLink,
    Robot,
)
from stiffness.reading import BadInput, Table, describe, number_array, read_toml
from stiffness.screws import rotation_matrix, rotation_vector

_SECTIONS: dict[str, tuple[str, ...]] = {  # required keys of each kind of section
    "round": ("radius",),
    "rectangular": ("width", "height"),
    "general": ("area", "I_y", "I_z", "J", "shear_y", "shear_z"),
}
_SECTION_UNITS = {"area": "m^2", "I_y": "m^4", "I_z": "m^4", "J": "m^4"}
UNITS = ("m", "dm", "cm", "mm", "um", "in", "ft")
_LINK_KINDS = ("beam", "stiffness", "mesh", "library")
_JOINT_KEYS = ("clearance", "joint_stiffness")


def read_robot(path: Path | str) -> Robot:
    """Robot of a robot file.

    Args:
        path: a ``.toml`` file in the public format.

    Returns:
        The robot; that its closures hold is checked where it is placed.

    Raises:
        BadInput: the file breaks a rule of the format.
    """
    root = read_toml(Path(path))
    name = root.text("name", Path(path).stem)
    description = root.get("description", "")
    if not isinstance(description, str):
        found = describe(description)
        raise root.bad("description", f"found {found}, expected a string")
    platform = root.text("platform")
    frames = tuple(_frame(table) for table in root.tables("frame"))
    if not frames:
        raise root.bad("frame", "missing; expected at least one [[frame]]")
    closures = tuple(_closure(table) for table in root.tables("closure"))
    root.finish()
    try:
        robot = Robot(name, platform, frames, closures, description)
        _check_meeting_frames(robot)
        _check_beams(robot)
    except BadInput as error:
        raise BadInput(f"{root.file}: {error}") from None
    return robot


def _frame(table: Table) -> Frame:
    """One ``[[frame]]``."""
    name = table.text("name")
    table.place = f'frame "{name[:60]}"'
    joint = table.choice("joint", JOINTS, "fixed")
    actuated = table.boolean("actuated", False)
    if joint == "fixed" and (actuated or table.has("position")):
        key = "actuated" if actuated else "position"
        message = 'found one, but the joint is fixed; expected joint = "revolute" | '
        raise table.bad(key, message + '"prismatic", or no such key')
    translation, rotation = _placement(table)
    frame = Frame(
        name=name,
        parent=table.text("parent"),
        translation=translation,
        rotation=rotation,
        joint=joint,
        actuated=actuated,
        position=table.number("position", "rad or m", 0.0),
        geometric_error=table.array("geometric_error", (6,), "rad, m", np.zeros(6)),
        clearance=_clearance(table),
        joint_stiffness=_joint_stiffness(table),
        link=_link(table),
        mass=table.number("mass", "kg", 0.0, least=0.0),
        centre_of_mass=table.array("centre_of_mass", (3,), "m", np.zeros(3)),
    )
    table.finish()
    return frame


def _placement(table: Table) -> tuple[NDArray, NDArray]:
    """Translation and rotation vector, given as such or by ``dh``."""
    if not table.has("dh"):
        zero = np.zeros(3)
        return (
            table.array("translation", (3,), "m", zero),
            table.array("rotation", (3,), "rad", zero),
        )
    for key in ("translation", "rotation"):
        if table.has(key):
            raise table.bad(
                key, '"dh" already places this frame; give one or the other'
            )
    dh = table.table("dh")
    theta, alpha = dh.number("theta", "rad", 0.0), dh.number("alpha", "rad", 0.0)
    d, a = dh.number("d", "m", 0.0), dh.number("a", "m", 0.0)
    dh.finish()
    # Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha)
    translation = np.array([a * math.cos(theta), a * math.sin(theta), d])
    turn = rotation_matrix([0, 0, theta]) @ rotation_matrix([alpha, 0, 0])
    return translation, rotation_vector(turn)


def _clearance(table: Table) -> Clearance | None:
    """The ``clearance`` table."""
    if not table.has("clearance"):
        return None
    inner = table.table("clearance")
    units = {"radial": "m", "axial": "m", "tilt": "rad", "spin": "rad"}
    bounds = {
        key: inner.number(key, unit, least=0.0)
        for key, unit in units.items()
        if inner.has(key)
    }
    inner.finish()
    return Clearance(**bounds)


def _joint_stiffness(table: Table) -> NDArray | None:
    """K_B as a full matrix; infinities only on its diagonal."""
    if not table.has("joint_stiffness"):
        return None
    value = table.content["joint_stiffness"]
    expected = "6 diagonal terms > 0 or inf, or 6 rows of 6 [N m/rad .. N/m]"
    given = number_array(value)
    if given is None or given.shape not in {(6,), (6, 6)} or np.isnan(given).any():
        found = describe(value)
        raise table.bad("joint_stiffness", f"found {found}, expected {expected}")
    K = np.diag(given) if given.ndim == 1 else given
    rigid = np.isposinf(np.diag(K))
    finite = K[np.ix_(~rigid, ~rigid)]
    rest = K.copy()
    rest[~rigid[:, None] & ~rigid] = 0.0  # what must vanish around an infinity
    np.fill_diagonal(rest, 0.0)
    if np.any(rest != 0.0) or not np.isfinite(finite).all():
        raise table.bad(
            "joint_stiffness",
            "inf may stand only on the diagonal, its row and column otherwise zero",
        )
    _check_definite(table, "joint_stiffness", finite)
    return K


def _check_definite(table: Table, key: str, K: NDArray) -> None:
    """Refuse a matrix that is not symmetric positive definite, saying where."""
    size = np.sqrt(np.abs(np.diag(K)))
    asymmetry = np.abs(K - K.T) - 1e-9 * np.outer(size, size)
    if K.size and asymmetry.max() > 0:
        i, j = np.unravel_index(np.argmax(asymmetry), K.shape)
        raise table.bad(
            key,
            f"not symmetric: [{i + 1}, {j + 1}] = {K[i, j]:.6e} but "
            f"[{j + 1}, {i + 1}] = {K[j, i]:.6e}; expected a symmetric matrix",
        )
    if K.size and np.diag(K).min() <= 0:
        i = int(np.argmin(np.diag(K)))
        raise table.bad(
            key,
            f"not positive definite: diagonal term {K[i, i]:.6e}; expected > 0",
        )
    # scaled to a unit diagonal, so that rad and m weigh alike
    least = np.linalg.eigvalsh(K / np.outer(size, size)).min() if K.size else 1.0
    if least <= 1e-14:
        raise table.bad(
            key,
            f"not positive definite: smallest scaled eigenvalue {least:.1e}; "
            "expected a symmetric positive definite matrix",
        )


def _link(table: Table) -> Link | None:
    """The ``link`` table: exactly one of beam, stiffness, mesh, library."""
    if not table.has("link"):
        return None
    link = table.table("link")
    kinds = [kind for kind in _LINK_KINDS if link.has(kind)]
    if len(kinds) != 1:
        wrong = next((k for k in link.content if k not in _MATERIAL), None)
        if not kinds and wrong is not None:
            link.finish()
        found = " and ".join(f'"{k}"' for k in kinds) or "none of them"
        names = " | ".join(f'"{k}"' for k in _LINK_KINDS)
        raise link.bad("", f"found {found}, expected exactly one of {names}")
    read = {
        "beam": _beam_link,
        "stiffness": _matrix_link,
        "mesh": _mesh_link,
        "library": _library_link,
    }
    answer = read[kinds[0]](link)
    link.finish()
    return answer


_MATERIAL = ("young", "poisson", "density")


def _material(link: Table) -> dict[str, Any]:
    """Young's modulus, Poisson's ratio and, if given, density."""
    return {
        "young": link.number("young", "Pa", above=0.0),
        "poisson": link.number("poisson", "-", above=-1.0, below=0.5),
        "density": link.number("density", "kg/m^3", above=0.0)
        if link.has("density")
        else None,
    }


def _direction(table: Table, key: str) -> tuple[float, float, float] | None:
    """A direction, None if absent."""
    if not table.has(key):
        return None
    vector = table.array(key, (3,), "direction")
    if not np.linalg.norm(vector) > 0:
        raise table.bad(key, "found a zero vector, expected a direction")
    x, y, z = vector.tolist()
    return x, y, z


def _beam_link(link: Table) -> BeamLink:
    """``beam = { ... }`` and its material."""
    beam = link.table("beam")
    theory = beam.choice("theory", ("timoshenko", "euler"), "timoshenko")
    length = beam.number("length", "m", above=0.0) if beam.has("length") else None
    axis = _direction(beam, "axis")
    if (length is None) != (axis is None):
        missing = "length" if length is None else "axis"
        raise beam.bad(missing, 'missing; "length" and "axis" are given together')
    up = _direction(beam, "up")
    section = _section(beam)
    beam.finish()
    return BeamLink(section, **_material(link), theory=theory, length=length,
                    axis=axis, up=up)  # fmt: skip


def _section(beam: Table) -> dict[str, float]:
    """Numbers of the section, one of the three kinds."""
    kinds = [
        kind
        for kind, keys in _SECTIONS.items()
        if any(key in beam.content for key in keys)
    ]
    if len(kinds) != 1:
        for keys in _SECTIONS.values():  # so that a misspelt one gets its suggestion
            any(beam.has(key) for key in keys)
        beam.has("inner_radius")
        beam.finish()
        raise beam.bad(
            "", 'found no section or two, expected "radius" [, "inner_radius"] or '
            '"width", "height" or "area", "I_y", "I_z", "J", "shear_y", "shear_z"',
        )  # fmt: skip
    section = {
        key: beam.number(key, _SECTION_UNITS.get(key, "m"), above=0.0)
        for key in _SECTIONS[kinds[0]]
    }
    if kinds == ["round"] and beam.has("inner_radius"):
        section["inner_radius"] = beam.number(
            "inner_radius", "m", least=0.0, below=section["radius"]
        )
    return section


def _matrix_link(link: Table) -> MatrixLink:
    """``stiffness = [[...], ...]``."""
    K = link.array("stiffness", (6, 6), "N m/rad .. N/m")
    _check_definite(link, "stiffness", K)
    return MatrixLink(K)


def _mesh_link(link: Table) -> MeshLink:
    """``mesh = { surface, base, tip, ... }`` and its material."""
    from stiffness.mesh import parse_interface

    mesh = link.table("mesh")
    ends = {}
    for key in ("base", "tip"):
        ends[key] = mesh.require(key, 'an interface such as "z=0.452"')
        try:
            parse_interface(ends[key])
        except ValueError as error:
            raise mesh.bad(key, str(error)) from None
    answer = MeshLink(
        surface=_beside(mesh, mesh.text("surface")),
        **ends,
        **_material(link),
        unit=mesh.choice("unit", UNITS, "m"),
        up=_direction(mesh, "up"),
        frame_up=_direction(link, "up"),
        interface=mesh.choice("interface", ("rigid", "distributing"), "rigid"),
    )
    mesh.finish()
    return answer


def _library_link(link: Table) -> LibraryLink:
    """``library = "path/to/library#key"``."""
    value = link.text("library")
    path, hash_sign, key = value.rpartition("#")
    if not (hash_sign and path and key):
        found = describe(value)
        raise link.bad("library", f'found {found}, expected "path/to/library#key"')
    return LibraryLink(_beside(link, path), key)


def _beside(table: Table, path: str) -> Path:
    """A path relative to the file that names it."""
    return Path(table.file).parent / path


def _closure(table: Table) -> tuple[str, str]:
    """One ``[[closure]]``."""
    value = table.require("frames", "two frame names")
    proper = isinstance(value, list) and all(isinstance(v, str) for v in value)
    if not proper or len(value) != 2 or value[0] == value[1]:
        message = f"found {describe(value)}, expected two different frame names"
        raise table.bad("frames", message)
    table.finish()
    return value[0], value[1]


def _check_meeting_frames(robot: Robot) -> None:
    """A frame where chains meet must have no joint of its own."""
    meeting = {"platform": [robot.platform]}
    for number, pair in enumerate(robot.closures, 1):
        meeting[f"closure[{number}].frames"] = list(pair)
    for place, names in meeting.items():
        for name in names:
            frame = robot.frame(name)
            has = [key for key in _JOINT_KEYS if getattr(frame, key) is not None]
            if frame.joint != "fixed" or has:
                found = has[0] if has else f"a {frame.joint} joint"
                raise BadInput(
                    f'{place}: frame "{name}" has {found}; expected a fixed joint '
                    "without clearance or joint_stiffness (add a fixed frame after it)"
                )


def _check_beams(robot: Robot) -> None:
    """A straight beam needs two origins apart, and no prismatic joint between."""
    for frame in robot.frames:
        if not isinstance(frame.link, BeamLink) or frame.link.length is not None:
            continue
        place = f'frame "{frame.name}".link.beam'
        parent = None if frame.parent == BASE else robot.frame(frame.parent)
        if parent is not None and parent.joint == "prismatic":
            raise BadInput(
                f'{place}: below the prismatic joint of "{parent.name}" the distance '
                'of the origins changes; expected "length" and "axis"'
            )
        if not np.linalg.norm(frame.translation) > 0:
            raise BadInput(
                f"{place}: this frame's origin is its parent's, found length 0; "
                'expected a translation, or "length" and "axis"'
            )


def write_robot(robot: Robot, path: Path | str) -> None:
    """Write a robot file that :func:`read_robot` reads back to the same robot.

    Args:
        robot: to be written.
        path: of the new file; paths of meshes are written as they are.

    Raises:
        OSError: the file cannot be written.
    """
    Path(path).write_text(robot_text(robot), encoding="utf-8")


def robot_text(robot: Robot) -> str:
    """The robot file of a robot, as text.

    Args:
        robot: any.

    Returns:
        TOML in the public format, all digits kept.
    """
    lines = [f"name = {_toml(robot.name)}"]
    if robot.description:
        lines.append(f"description = {_toml(robot.description)}")
    lines.append(f"platform = {_toml(robot.platform)}")
    for frame in robot.frames:
        lines += ["", "[[frame]]"]
        lines += [f"{k} = {_toml(v)}" for k, v in frame_table(frame).items()]
    for pair in robot.closures:
        lines += ["", "[[closure]]", f"frames = {_toml(list(pair))}"]
    return "\n".join(lines) + "\n"


def frame_table(frame: Frame) -> dict[str, Any]:
    """What ``[[frame]]`` says of a frame, defaults left out.

    Args:
        frame: of a robot.

    Returns:
        Keys and plain values of the file format.
    """
    table: dict[str, Any] = {"name": frame.name, "parent": frame.parent}
    table["translation"] = frame.translation.tolist()
    table["rotation"] = frame.rotation.tolist()
    if frame.joint != "fixed":
        table |= {"joint": frame.joint, "position": frame.position}
        if frame.actuated:
            table["actuated"] = True
    if np.any(frame.geometric_error):
        table["geometric_error"] = frame.geometric_error.tolist()
    if frame.clearance is not None:
        given = vars(frame.clearance).items()
        table["clearance"] = {k: v for k, v in given if v is not None}
    if frame.joint_stiffness is not None:
        K = frame.joint_stiffness
        diagonal = np.array_equal(K, np.diag(np.diag(K)))
        table["joint_stiffness"] = (np.diag(K) if diagonal else K).tolist()
    if frame.link is not None:
        table["link"] = _link_table(frame.link)
    if frame.mass:
        table["mass"] = frame.mass
    if np.any(frame.centre_of_mass):
        table["centre_of_mass"] = frame.centre_of_mass.tolist()
    return table


def _link_table(link: Link) -> dict[str, Any]:
    """What ``link = { ... }`` says."""
    if isinstance(link, MatrixLink):
        return {"stiffness": link.stiffness.tolist()}
    if isinstance(link, LibraryLink):
        return {"library": f"{link.library}#{link.key}"}
    names = ("theory", "length", "axis", "up")
    if isinstance(link, BeamLink):
        table: dict[str, Any] = {"beam": dict(link.section)}
        inner = table["beam"]
    else:
        names = ("base", "tip", "unit", "up", "interface")
        table = {"mesh": {"surface": str(link.surface)}}
        inner = table["mesh"]
        if link.frame_up is not None:
            table["up"] = list(link.frame_up)
    for name in names:
        value = getattr(link, name)
        if value is not None:
            inner[name] = list(value) if isinstance(value, tuple) else value
    for name in _MATERIAL:
        if getattr(link, name) is not None:
            table[name] = getattr(link, name)
    return table


def _toml(value: object) -> str:
    """A value in TOML; floats keep all their digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return (
            '"' + "".join(c if c >= " " else f"\\u{ord(c):04x}" for c in escaped) + '"'
        )
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return repr(value)
