"""Loops files (``robot.yaml``), which add loops and drives to a URDF.

The format was defined by the project example-parallel-robots.  ``closed_loop`` lists
pairs of joints or links whose frames coincide.  ``type`` is ``6d`` if the entire frames
coincide, and ``3d`` if only their origins coincide.  ``name_mot`` lists the drives.
``joint_name`` and ``joint_type`` declare joints as SPHERICAL, FIXED or as a UJOINT
about two axes (_XY, _YX, ..), because CAD programs export such joints as a single
rotation.  The keys ``home`` (coordinates by joint) and ``platform`` are extensions of
forcefit.

The generator of that project writes ``6d`` for all loops, and users are expected to
correct the types.  Therefore, if a file contains only ``6d`` and its loops cannot be
closed, they are closed only at points.

Sources:
    Batto, de Matteis, example-parallel-robots: ``loader_tools.py``, ``generateYAML``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import BadInput, describe, nearest, one_line, quoted
from forcefit.inputs.packages import naming_packages
from forcefit.inputs.table import Table, read_text

_KNOWN = (
    "closed_loop", "type", "name_mot", "joint_name", "joint_type", "home", "platform",
)  # fmt: skip
TURNS = {"FIXED": "", "SPHERICAL": "xyz"} | {
    f"UJOINT_{axes.upper()}": axes for axes in ("xy", "yz", "zx", "yx", "zy", "xz")
}


@dataclass(frozen=True)
class LoopsFile:
    """Content of a loops file.

    Attributes:
        file: name of the file, for messages.
        pairs: names of joints or links whose frames coincide.
        points: whether only the origins of the frames coincide, for each pair.
        drives: names of the driven joints; None if the file does not list them.
        turns: rotation axes by joint, for example ``"xyz"`` for a ball joint.
        home: coordinates at home [rad or m], by joint.
        platform: name of a link, or None.
        passed_over: unknown keys, which are ignored.
    """

    file: str = ""
    pairs: tuple[tuple[str, str], ...] = ()
    points: tuple[bool, ...] = ()
    drives: tuple[str, ...] | None = None
    turns: Mapping[str, str] = field(default_factory=dict)
    home: Mapping[str, float] = field(default_factory=dict)
    platform: str | None = None
    passed_over: tuple[str, ...] = ()

    @property
    def as_generated(self) -> bool:
        """Whether all loops are declared as 6d, as in a generated file."""
        return bool(self.pairs) and not any(self.points)


def find_loops_file(robot: Path) -> Path | None:
    """Return the path of the loops file next to a robot file, or None."""
    for path in (robot.with_suffix(".yaml"), robot.parent / "robot.yaml"):
        if path.is_file():
            return path
    return None


def read_loops(path: Path | str) -> LoopsFile:
    """Read a loops file.

    Args:
        path: YAML file.

    Returns:
        The content of the file.

    Raises:
        BadInput: the file is not YAML, or a key has an invalid value.
    """
    table = Table(_yaml(path), str(path), "")
    given = _list(table, "closed_loop")
    pairs = tuple(_pair(table, i, pair) for i, pair in enumerate(given, 1))
    kinds = _list(table, "type") if table.has("type") else ["6d"] * len(pairs)
    if len(kinds) != len(pairs):
        message = f"found {len(kinds)}, expected one for each of {len(pairs)} loops"
        raise table.bad("type", message)
    for kind in kinds:
        if str(kind).lower() not in {"6d", "3d"}:
            raise table.bad("type", f'found {describe(kind)}, expected "6d" or "3d"')
    home = table.get("home") or {}
    if not isinstance(home, dict):
        raise table.bad("home", f"found {describe(home)}, expected a table")
    positions = Table({str(k): v for k, v in home.items()}, str(path), "home")
    return LoopsFile(
        file=str(path),
        pairs=pairs,
        points=tuple(str(kind).lower() == "3d" for kind in kinds),
        drives=_names(table, "name_mot") if table.has("name_mot") else None,
        turns=_turns(table),
        home={k: positions.number(k, "rad or m") for k in positions.content},
        platform=table.text("platform") if table.has("platform") else None,
        passed_over=tuple(str(k) for k in table.content if k not in _KNOWN),
    )


def with_points(loops: LoopsFile, names: Sequence[str]) -> LoopsFile:
    """Set the type of the named loops to 3d, which closes them only at a point.

    Args:
        loops: content of a loops file.
        names: names of loops.  A loop is named by its number (``loop1``) or by one of
            its joints or links; ``all`` denotes all loops.

    Returns:
        Loops with the new types.

    Raises:
        BadInput: a name does not belong to any loop.
    """
    of_loop: dict[str, set[int]] = {"all": set(range(len(loops.pairs)))}
    for i, pair in enumerate(loops.pairs):
        for name in (f"loop{i + 1}", *pair):
            of_loop.setdefault(name, set()).add(i)
    for name in names:
        if name not in of_loop:
            raise BadInput(
                f"--points: found {quoted(name)}, expected a loop of {loops.file}"
                f"{nearest(name, of_loop)}"
            )
    chosen = set().union(*(of_loop[name] for name in names))
    points = tuple(point or i in chosen for i, point in enumerate(loops.points))
    return replace(loops, points=points)


def loops_text(loops: LoopsFile) -> str:
    """Return the text of a loops file, with numbers in full precision."""
    rows = [f"[{_word(a)}, {_word(b)}]" for a, b in loops.pairs]
    kinds = ["3d" if point else "6d" for point in loops.points]
    lines = [
        "# Written by forcefit.",
        f"closed_loop: [{', '.join(rows)}]",
        f"type: [{', '.join(map(_word, kinds))}]",
        f"name_mot: [{', '.join(map(_word, loops.drives or ()))}]",
    ]
    if loops.platform is not None:
        lines.append(f"platform: {_word(loops.platform)}")
    if loops.home:
        lines.append("home:")
        lines += [f"  {_word(k)}: {_number(q)}" for k, q in loops.home.items()]
    return "\n".join(lines) + "\n"


def _reason(error: Exception) -> str:
    """Return the position and cause of a YAML error on one line."""
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", "")
    if mark is None or not problem:
        return one_line(str(error), 200)
    return f"line {mark.line + 1}, column {mark.column + 1}: {one_line(problem, 200)}"


def _yaml(path: Path | str) -> dict[str, Any]:
    """Return the root mapping of a YAML file."""
    with naming_packages(f"{path}: YAML"):
        import yaml

    text = read_text(path)
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise BadInput(f"{path}: not valid YAML: {_reason(error)}") from None
    if not isinstance(content, dict):
        kind = "an empty file" if content is None else describe(content)
        raise BadInput(f"{path}: found {kind}, expected keys such as closed_loop")
    content = {str(k): v for k, v in content.items()}
    if "closed_loop" not in content:
        hint = nearest("closed_loop", content)
        hint = hint if "did you mean" in hint else ""
        raise BadInput(f"{path}: closed_loop: missing; expected pairs of names{hint}")
    return content


def _list(table: Table, key: str) -> list[Any]:
    """Return the list under a key of a table; the list may be empty."""
    value = table.get(key)
    if value is None:
        return []
    if not isinstance(value, list):
        raise table.bad(key, f"found {describe(value)}, expected a list")
    return value


def _names(table: Table, key: str) -> tuple[str, ...]:
    """Return a list of names under a key of a table."""
    values = _list(table, key)
    for value in values:
        if not isinstance(value, str):
            raise table.bad(key, f"found {describe(value)}, expected names of joints")
    return tuple(values)


def _turns(table: Table) -> dict[str, str]:
    """Return the rotation axes of joints from ``joint_name`` and ``joint_type``."""
    names, kinds = _names(table, "joint_name"), _names(table, "joint_type")
    if len(names) != len(kinds):
        message = f"found {len(kinds)}, expected one for each of {len(names)} joints"
        raise table.bad("joint_type", message)
    for kind in kinds:
        if kind not in TURNS:
            hint = nearest(kind, TURNS)
            raise table.bad("joint_type", f"found {describe(kind)}{hint}")
    return {name: TURNS[kind] for name, kind in zip(names, kinds, strict=True)}


def _pair(table: Table, index: int, pair: object) -> tuple[str, str]:
    """Return the two names of a loop, which must differ."""
    names = pair if isinstance(pair, list) else []
    names = [name for name in names if isinstance(name, str)]
    if len(names) != 2 or pair != names or names[0] == names[1]:
        message = f"found {describe(pair)}, expected two different names"
        raise table.bad(f"closed_loop[{index}]", message)
    return names[0], names[1]


def unknown_name(loops: LoopsFile, key: str, name: str, valid: list[str]) -> str:
    """Return the error message for a name that is not a joint or link."""
    return (
        f"{loops.file}: {key}: found {quoted(name)}, expected a joint or link of the "
        f"robot{nearest(name, valid)}"
    )


def _word(text: str) -> str:
    """Return a text in double quotes, as in YAML and JSON."""
    import json

    return json.dumps(text)


def _number(value: float) -> str:
    """Return a number as text, with the decimal point that YAML requires."""
    text = repr(float(value))
    mantissa, e, exponent = text.partition("e")
    if e and "." not in mantissa:
        mantissa += ".0"
    if e and exponent[0] not in "+-":
        exponent = f"+{exponent}"
    return mantissa + e + exponent
