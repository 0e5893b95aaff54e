"""Library entries of parts given by their surface: one link, not a family.

Such an entry is kept as long as the surface file's content and everything else that was
asked for are what it was made from, and made again when one of them changed.
"""

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from forcefit.inputs.table import BadInput, Table, describe, quoted
from stiffness.link import LinkStiffness
from stiffness.surface.interface import parse_interface
from stiffness.surface.surface import UNITS

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class SurfaceLink:
    """A part that a library is to hold.

    Attributes:
        name: its key in the library.
        surface: file, relative to the build file's folder or absolute.
        base: the held interface, as written.
        tip: the interface that moves.
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3], 0 leaves mass and inertia out.
        unit: of the surface file.
        interface: one of :data:`stiffness.fem.condensation.KINDS`.
        accuracy: [1] asked of every entry of K.
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

    @property
    def parameters(self) -> dict[str, float]:
        """The material, as entries of a grid state it."""
        given = {"young": self.young, "poisson": self.poisson}
        return given | ({"density": self.density} if self.density else {})

    def request(self) -> dict[str, Any]:
        """All that the entry depends on, with the surface file's digest.

        Returns:
            Plain values, the same for the same question.

        Raises:
            BadInput: the surface file cannot be read.
        """
        try:
            content = self.surface.read_bytes()
        except OSError as error:
            raise BadInput(
                f"{self.surface}: cannot be read: {error.strerror}"
            ) from None
        given = {k: v for k, v in asdict(self).items() if k not in {"name", "surface"}}
        return given | {"surface_digest": hashlib.sha256(content).hexdigest()}

    def solve(self) -> LinkStiffness:
        """The link by finite elements.

        Returns:
            The stiffness at the tip's centre, in the surface's axes.

        Raises:
            BadInput: the surface or an interface is not usable.
        """
        from stiffness.fem.fea import FemOptions, mesh_link
        from stiffness.fem.material import Material

        try:
            return mesh_link(
                self.surface,
                parse_interface(self.base, "base"),
                parse_interface(self.tip, "tip"),
                Material(self.young, self.poisson, self.density), unit=self.unit,
                options=FemOptions(self.accuracy, self.interface),
            )  # fmt: skip
        except BadInput as error:
            raise BadInput(f"link {quoted(self.name)}: {error}") from None


def read_surface_links(root: Table, accuracy: float) -> tuple[SurfaceLink, ...]:
    """The tables ``[[link]]`` of a build file.

    Args:
        root: the file's table.
        accuracy: of links that do not state one.

    Returns:
        The links, in order.

    Raises:
        BadInput: a rule is broken, a file is missing, or a name stands there twice.
    """
    from stiffness.fem.condensation import KINDS

    links: dict[str, SurfaceLink] = {}
    for table in root.tables("link"):
        name = table.text("name")
        if not _NAME.fullmatch(name):
            expected = "letters, digits, dots, - and _, a letter or digit first"
            raise table.bad("name", f"found {describe(name)}, expected {expected}")
        if name in links:
            raise table.bad("name", f"found {quoted(name)} twice, expected other names")
        surface = Path(root.file).parent / table.text("surface")
        if not surface.is_file():
            raise table.bad("surface", f"found no file {surface}, expected a surface")
        links[name] = SurfaceLink(
            name=name,
            surface=surface,
            base=_interface(table, "base"),
            tip=_interface(table, "tip"),
            young=table.number("young", "Pa", above=0.0),
            poisson=table.number("poisson", "-", above=-1.0, below=0.5),
            density=table.number("density", "kg/m^3", 0.0, least=0.0),
            unit=table.choice("unit", UNITS, "m"),
            interface=table.choice("interface", KINDS, "rigid"),
            accuracy=table.number("accuracy", "1", accuracy, least=1e-5, below=0.5),
        )
        table.finish()
    return tuple(links.values())


def _interface(table: Table, key: str) -> Any:
    """An interface as written, its syntax checked."""
    value = table.require(key, 'an interface such as "z=0.452"')
    parse_interface(value, f"{table.file}: {table.place}.{key}")
    return value


def is_current(file: Path, link: SurfaceLink) -> bool:
    """Whether an entry is there and was made from what is asked for now.

    Args:
        file: of the entry.
        link: what is asked for.

    Returns:
        False also for a file that is damaged.

    Raises:
        BadInput: the surface file cannot be read.
    """
    request = json.loads(json.dumps(link.request()))
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(stored, dict) and stored.get("request") == request
