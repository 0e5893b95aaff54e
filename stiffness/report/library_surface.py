"""Library entries for parts given by surfaces.

A family of parts is a CSV table with surface files and sizes. The function ``look_up``
interpolates between the parts of a family. An entry is recomputed if its surface file
or a setting has changed.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import LARGEST
from forcefit.inputs.table import BadInput, Table, describe, quoted, read_rows
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import UNITS
from forcefit.stiffness.surface.surface_files import named_solid

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class SurfaceLink:
    """A part in a library, given by its surface.

    Attributes:
        name: name of the entry in the library.
        surface: path of the surface file.
        base: text of the clamped interface.
        tip: text of the loaded interface.
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] density; 0 to omit mass and inertia.
        unit: unit of length in the surface file.
        interface: one of :data:`forcefit.stiffness.fem.condensation.KINDS`.
        accuracy: [1] largest accepted relative error of the stiffness.
        family: name of the family of this part; empty for a single part.
        sizes: [m] sizes of this part, by name; empty for a single part.
        parts: texts of materials in parts of the link, see
            :func:`forcefit.stiffness.fem.part_text.parse_part`.
    """

    name: str
    surface: Path
    base: Any
    tip: Any
    young: float
    poisson: float
    density: float = 0.0
    unit: str = "m"
    interface: str = "rigid"
    accuracy: float = 0.005
    family: str = ""
    sizes: Mapping[str, float] = field(default_factory=dict)
    parts: tuple[str, ...] = ()

    @property
    def parameters(self) -> dict[str, float]:
        """Sizes [m] and material constants by name."""
        given = dict(self.sizes) | {"young": self.young, "poisson": self.poisson}
        return given | ({"density": self.density} if self.density else {})

    def request(self) -> dict[str, Any]:
        """Collect all data on which the entry depends.

        Returns:
            The settings and a hash of the surface file, as plain values.

        Raises:
            BadInput: the surface file cannot be read.
        """
        file, solid = named_solid(self.surface)
        try:
            content = file.read_bytes()
        except OSError as error:
            raise BadInput(
                f"{self.surface}: cannot be read: {error.strerror}"
            ) from None
        given = {k: v for k, v in asdict(self).items() if k not in {"name", "surface"}}
        if not self.parts:
            del given["parts"]
        if not self.family:  # a single part
            del given["family"], given["sizes"]
        if solid:
            given["solid"] = solid
        return given | {"surface_digest": hashlib.sha256(content).hexdigest()}

    def solve(self) -> LinkStiffness:
        """Compute the stiffness of the part by finite elements.

        Returns:
            The stiffness at the tip's centre, in the axes of the surface.

        Raises:
            BadInput: the surface or an interface is invalid.
        """
        from forcefit.stiffness.fem.fea import FemOptions, solve_link
        from forcefit.stiffness.fem.material import Material
        from forcefit.stiffness.fem.part_text import parse_part
        from forcefit.stiffness.surface.surface import read_surface

        first = Material(self.young, self.poisson, self.density)
        try:
            return solve_link(
                read_surface(self.surface, self.unit),
                parse_interface(self.base, "base"),
                parse_interface(self.tip, "tip"),
                [first, *(parse_part("parts", text) for text in self.parts)],
                options=FemOptions(self.accuracy, self.interface),
            ).link
        except BadInput as error:
            raise BadInput(f"link {quoted(self.name)}: {error}") from None


def read_surface_links(root: Table, accuracy: float) -> tuple[SurfaceLink, ...]:
    """Read the tables ``[[link]]`` and ``[[family]]`` of a build file.

    Args:
        root: content of the file.
        accuracy: default of the accuracy of a part.

    Returns:
        The parts in the order of the file.

    Raises:
        BadInput: a value is invalid, a file is missing, or a name is given twice.
    """
    links: dict[str, SurfaceLink] = {}
    for table in root.tables("link"):
        surface = Path(root.file).parent / table.text("surface")
        if not os.path.isfile(named_solid(surface)[0]):
            raise table.bad("surface", f"found no file {surface}, expected a surface")
        link = _link(table, surface, accuracy)
        for key in ("base", "tip"):
            parse_interface(getattr(link, key), f"{table.file}: {table.place}.{key}")
        _add(links, link, table)
    for table in root.tables("family"):
        file = Path(root.file).parent / table.text("table")
        common = _link(table, file, accuracy)
        for link in family_of(common, file):
            _add(links, link, table)
    return tuple(links.values())


def _add(links: dict[str, SurfaceLink], link: SurfaceLink, table: Table) -> None:
    """Add a part, and reject a name that is already in use."""
    if link.name in links:
        found = f"found {quoted(link.name)} twice, expected different names"
        raise table.bad("name", found)
    links[link.name] = link


def _link(table: Table, surface: Path, accuracy: float) -> SurfaceLink:
    """Read the common keys of the tables ``[[link]]`` and ``[[family]]``."""
    from forcefit.stiffness.fem.condensation import KINDS
    from forcefit.stiffness.fem.part_text import read_parts

    name = table.text("name")
    if not _NAME.fullmatch(name):
        expected = (
            "letters, digits, dots, - and _, of which the first is a letter or a digit"
        )
        raise table.bad("name", f"found {describe(name)}, expected {expected}")
    link = SurfaceLink(
        name=name,
        surface=surface,
        base=table.require("base", 'an interface such as "z=0"'),
        tip=table.require("tip", 'an interface such as "z=0.452"'),
        young=table.number("young", "Pa", above=0.0),
        poisson=table.number("poisson", "-", above=-1.0, below=0.5),
        density=table.number("density", "kg/m^3", 0.0, least=0.0),
        unit=table.choice("unit", UNITS, "m"),
        interface=table.choice("interface", KINDS, "rigid"),
        accuracy=table.number("accuracy", "1", accuracy, least=1e-5, below=0.5),
        parts=read_parts(table),
    )
    table.finish()
    return link


def family_of(common: SurfaceLink, file: Path) -> list[SurfaceLink]:
    """Read the parts of a family from a CSV table.

    Args:
        common: settings of all parts. The texts of the interfaces may contain names of
            sizes in braces, such as ``"z={length}"``.
        file: CSV table with a column ``surface``, whose paths are relative to the
            folder of the table, and a column for each size [m].

    Returns:
        A part for each row of the table.

    Raises:
        BadInput: the table, a file or an interface is invalid.
    """
    rows = read_rows(file)
    head = [cell.strip() for cell in rows[0]] if rows else []
    names = [name for name in head if name != "surface"]
    if "surface" not in head or not names or len(set(head)) != len(head):
        raise BadInput(
            f"{file}: line 1: found {describe(','.join(head))}, expected a header with "
            "surface and a different name for each size"
        )
    links = []
    for number, row in enumerate(rows[1:], 2):
        place = f"{file}: line {number}"
        if len(row) != len(head):
            raise BadInput(
                f"{place}: found {len(row)} cells, expected {len(head)} as in the "
                "header"
            )
        cells = dict(zip(head, (cell.strip() for cell in row), strict=True))
        surface = file.parent / cells["surface"]
        if not os.path.isfile(named_solid(surface)[0]):
            raise BadInput(f"{place}: found no file {surface}, expected a surface file")
        sizes = {name: _size(place, name, cells[name]) for name in names}
        ends = {}
        for key in ("base", "tip"):
            ends[key] = _filled(getattr(common, key), sizes)
            parse_interface(ends[key], f"{place}: {key}")
        own = "-".join(f"{name}{value:.9g}" for name, value in sizes.items())
        links.append(replace(common, name=f"{common.name}-{own}", surface=surface,
                             family=common.name, sizes=sizes, **ends))  # fmt: skip
    if not links:
        raise BadInput(f"{file}: found no rows, expected a row for each part")
    return links


def _size(place: str, name: str, cell: str) -> float:
    """Parse the size in a cell of the table [m]."""
    try:
        value = float(cell)
    except ValueError:
        value = float("nan")
    if not 0.0 < value < LARGEST:
        expected = "a length above 0 [m]"
        raise BadInput(f"{place}, {name}: found {describe(cell)}, expected {expected}")
    return value


def _filled(interface: Any, sizes: Mapping[str, float]) -> Any:
    """Replace the names of sizes in the text of an interface by their values."""
    if not isinstance(interface, str):
        return interface
    for name, value in sizes.items():
        interface = interface.replace(f"{{{name}}}", repr(value))
    return interface


def is_current(file: Path, link: SurfaceLink) -> bool:
    """Return whether an entry exists and was computed with the current settings.

    Args:
        file: file of the entry.
        link: the part.

    Returns:
        True if the entry can be used.

    Raises:
        BadInput: the surface file cannot be read.
    """
    request = json.loads(json.dumps(link.request()))
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(stored, dict) and stored.get("request") == request
