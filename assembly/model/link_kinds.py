"""Elastic link models: beam, stiffness matrix, mesh and library entry."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from forcefit.assembly.model.equal_data import EqualData

if TYPE_CHECKING:
    from forcefit.stiffness.fem.fea import MeshedLink


@dataclass(frozen=True)
class BeamLink:
    """Straight beam between the origins of the parent and the frame.

    Attributes:
        section: dimensions of the cross section, for example ``{"radius": 0.04}`` [m].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio [-].
        density: density [kg/m^3]; None if the link has no declared mass.
        theory: ``"timoshenko"`` or ``"euler"``.
        length: length of the beam [m]; None for the distance between both origins.
        axis: unit vector from base to tip in the frame axes, used with ``length``.
        up: direction of the height of the cross section in the frame axes, or None.
        pieces: number of elements in series for finite motions; not used for small
            motions.
    """

    section: dict[str, float]
    young: float
    poisson: float
    density: float | None = None
    theory: str = "timoshenko"
    length: float | None = None
    axis: tuple[float, float, float] | None = None
    up: tuple[float, float, float] | None = None
    pieces: int = 1


@dataclass(frozen=True, eq=False)
class MatrixLink(EqualData):
    """Link defined by its stiffness matrix.

    Attributes:
        stiffness: symmetric positive definite K_E (6, 6) [N m/rad .. N/m] at the frame,
            in the frame axes.
    """

    stiffness: NDArray

    @cached_property
    def _hash(self) -> int:
        return hash(self.stiffness.tobytes())


@dataclass(frozen=True, eq=False)
class MeshSolution(EqualData):
    """Finite-element solution of a mesh link, in the axes of the mesh.

    Attributes:
        solved: stiffness and fields on the finest mesh.
        young: Young's modulus used in the solution [Pa].
        digest: SHA-256 hash of the surface file.
        mass: consistent mass matrix (12, 12) [kg m^2 .. kg] for the screws of base and
            tip, each at its own interface; zero if no density is given.
    """

    solved: "MeshedLink"
    young: float
    digest: str
    mass: NDArray

    def _data(self) -> tuple[Any, ...]:
        # These data determine the finite-element solution.
        return self.solved.link.compliance, self.young, self.digest, self.mass


@dataclass(frozen=True)
class MeshLink:
    """Link whose K_E is computed by finite elements from its surface.

    Attributes:
        surface: surface file.
        base: interface on the parent side, as specified in robot files.
        tip: interface on the frame side.
        young: Young's modulus [Pa].
        poisson: Poisson's ratio [-].
        density: density [kg/m^3], or None.
        unit: length unit of the surface file.
        up: direction in the mesh axes that, together with ``frame_up``, fixes the
            rotation about the link axis.
        frame_up: the same direction in the frame axes.
        axis: direction from base to tip in the frame axes; None for the direction from
            the parent origin to the frame origin.
        interface: ``"rigid"`` or ``"distributing"``.
        parts: regions with different materials, in the format of
            :func:`forcefit.stiffness.fem.part_text.parse_part`.
        solution: finite-element solution; None until
            :func:`forcefit.assembly.files.solved_links.solve_links` sets it.  It is
            not pickled.
    """

    surface: Path
    base: str | dict
    tip: str | dict
    young: float
    poisson: float
    density: float | None = None
    unit: str = "m"
    up: tuple[float, float, float] | None = None
    frame_up: tuple[float, float, float] | None = None
    interface: str = "rigid"
    axis: tuple[float, float, float] | None = None
    parts: tuple[str, ...] = ()
    solution: MeshSolution | None = field(default=None, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        # Solutions are large, so they are not pickled but recomputed.
        return {**vars(self), "solution": None}

    def __deepcopy__(self, memo: dict[int, Any]) -> "MeshLink":
        return self  # Instances are immutable.


@dataclass(frozen=True)
class LibraryLink:
    """Link whose K_E is an entry of a stiffness library.

    Attributes:
        library: path of the library.
        key: key of the entry.
        compliance: compliance of the entry (6, 6) [rad/(N m) .. m/N] at the frame, in
            the frame axes; None until
            :func:`forcefit.assembly.files.solved_links.solve_links` sets it.
    """

    library: Path
    key: str
    compliance: NDArray | None = field(default=None, compare=False, repr=False)


Link = BeamLink | MatrixLink | MeshLink | LibraryLink
