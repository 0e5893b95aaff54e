"""The kinds of elasticity of a body: a beam, a matrix, a mesh or a library."""

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
    """A straight beam between the parent's origin and the frame's.

    Attributes:
        section: the section's declared numbers, such as ``{"radius": 0.04}`` [m].
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] or None if the link has no declared mass.
        theory: ``"timoshenko"`` or ``"euler"``.
        length: [m] if it is not the distance of the origins, else None.
        axis: unit vector from base to tip in the frame's axes, given together with
            length.
        up: direction of the section's height in the frame's axes, or None.
        pieces: number of springs in series for finite motions; the number does not
            matter for small ones.
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
    """The finite elements of a mesh link, in the mesh's axes.

    Attributes:
        solved: stiffness and fields on the finest mesh.
        young: [Pa] modulus used in the solution.
        digest: SHA-256 of the surface file.
        mass: (12, 12) [kg m^2 .. kg] consistent mass for screws of base and tip, each
            read at its end; zero without a density.
    """

    solved: "MeshedLink"
    young: float
    digest: str
    mass: NDArray

    def _data(self) -> tuple[Any, ...]:
        # all fields of the finite elements follow from these
        return self.solved.link.compliance, self.young, self.digest, self.mass


@dataclass(frozen=True)
class MeshLink:
    """A link whose K_E comes from finite elements on its surface.

    Attributes:
        surface: the surface file.
        base: interface at the parent's side, as written in robot files.
        tip: interface at the frame's side.
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] or None.
        unit: length unit of the surface file.
        up: with ``frame_up`` fixes the rotation about the axis: a direction in the
            mesh's axes.
        frame_up: the same direction in the frame's axes.
        axis: direction from base to tip in the frame's axes; None from the parent's
            origin to the frame's.
        interface: ``"rigid"`` or ``"distributing"``.
        parts: parts of another material, as read by
            :func:`forcefit.stiffness.fem.part_text.parse_part`.
        solution: solution of its finite elements, None until
            :func:`forcefit.assembly.files.solved_links.solve_links`; it is not pickled.
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
        # tens of megabytes, which a worker computes from the same files
        return {**vars(self), "solution": None}

    def __deepcopy__(self, memo: dict[int, Any]) -> "MeshLink":
        return self  # frozen


@dataclass(frozen=True)
class LibraryLink:
    """A link whose K_E is kept in a stiffness library.

    Attributes:
        library: the library's path.
        key: the entry's key.
        compliance: (6, 6) [rad/(N m) .. m/N] of the entry, at the frame in its axes;
            None until :func:`forcefit.assembly.files.solved_links.solve_links`.
    """

    library: Path
    key: str
    compliance: NDArray | None = field(default=None, compare=False, repr=False)


Link = BeamLink | MatrixLink | MeshLink | LibraryLink
