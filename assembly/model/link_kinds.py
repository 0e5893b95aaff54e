"""Elasticity models of a body: beam, stiffness matrix, mesh or library entry."""

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
    """A straight beam between the origins of the parent and of the frame.

    Attributes:
        section: dimensions of the section, such as ``{"radius": 0.04}`` [m].
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] density; None if the link has no declared mass.
        theory: ``"timoshenko"`` or ``"euler"``.
        length: [m] length of the beam; None for the distance between the two origins.
        axis: unit vector from base to tip in the frame's axes, given together with
            ``length``.
        up: direction of the section's height in the frame's axes; None if it is not
            given.
        pieces: number of springs in series for finite motions; it has no effect on
            small motions.
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
    """A link given by its stiffness K_E at the frame, in the frame's axes.

    Attributes:
        stiffness: (6, 6) [N m/rad .. N/m] symmetric positive definite.
    """

    stiffness: NDArray

    @cached_property
    def _hash(self) -> int:
        return hash(self.stiffness.tobytes())


@dataclass(frozen=True, eq=False)
class MeshSolution(EqualData):
    """Finite-element solution of a mesh link, in the mesh's axes.

    Attributes:
        solved: stiffness and fields on the finest mesh.
        young: [Pa] modulus used in the solution.
        digest: SHA-256 of the surface file.
        mass: (12, 12) [kg m^2 .. kg] consistent mass for screws of base and tip, each
            at its end; zero without a density.
    """

    solved: "MeshedLink"
    young: float
    digest: str
    mass: NDArray

    def _data(self) -> tuple[Any, ...]:
        # the finite-element solution depends only on these data
        return self.solved.link.compliance, self.young, self.digest, self.mass


@dataclass(frozen=True)
class MeshLink:
    """A link whose K_E is computed by finite elements from its surface.

    Attributes:
        surface: the surface file.
        base: interface on the parent's side, as written in robot files.
        tip: interface on the frame's side.
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] density, or None.
        unit: length unit of the surface file.
        up: direction in the mesh's axes that, together with ``frame_up``, fixes the
            rotation about the axis.
        frame_up: the same direction in the frame's axes.
        axis: direction from base to tip in the frame's axes; None for the direction
            from the parent's origin to the frame's.
        interface: ``"rigid"`` or ``"distributing"``.
        parts: parts of other materials, as read by
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
        # a solution of tens of megabytes is not pickled; worker processes compute it
        # again
        return {**vars(self), "solution": None}

    def __deepcopy__(self, memo: dict[int, Any]) -> "MeshLink":
        return self  # the object is frozen


@dataclass(frozen=True)
class LibraryLink:
    """A link whose K_E is an entry of a stiffness library.

    Attributes:
        library: path of the library.
        key: key of the entry.
        compliance: (6, 6) [rad/(N m) .. m/N] compliance of the entry at the frame, in
            the frame's axes; None until
            :func:`forcefit.assembly.files.solved_links.solve_links` sets it.
    """

    library: Path
    key: str
    compliance: NDArray | None = field(default=None, compare=False, repr=False)


Link = BeamLink | MatrixLink | MeshLink | LibraryLink
