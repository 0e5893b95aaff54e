r"""Natural frequencies and modes at a posture, with the drives fixed.

The modes are the solutions of the eigenvalue problem

    (Z'HZ - omega^2 Z'MZ) t = 0.

Z'HZ is the tangent stiffness of
:mod:`forcefit.assembly.platform_stiffness.exact_tangent`.  The mass matrix M includes
all moving bodies.  The masses and moments of inertia of frames belong to rigid bodies.
A beam with a density has a consistent mass matrix for a cubic displacement, including
the rotary inertia of its cross-sections.  The mass matrix of a mesh link with a density
is condensed to both ends of the link.  Links defined by a matrix or a library have no
mass.

The cubic displacement overestimates the first frequency of a cantilever by 0.5 % with
one beam element and by 0.01 % with two elements.

Sources:
    Przemieniecki (1968), Theory of Matrix Structural Analysis, section 11.3 (consistent
    mass of a beam).
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.equilibrium import tangent_space
from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.exact.finite_robot import LINK
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.given_load import Load
from forcefit.assembly.model.link_kinds import Link
from forcefit.assembly.model.mesh_link import mesh_link_mass
from forcefit.assembly.model.robot import BeamLink, Frame, MeshLink, Robot, beam_axis
from forcefit.assembly.platform_stiffness.exact_tangent import (
    part_owners,
    platform_moves,
)
from forcefit.assembly.platform_stiffness.matrices import Part
from forcefit.assembly.solvers.method import Method
from forcefit.inputs.renamed import renamed_keywords
from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.beam.sections import declared_section
from forcefit.stiffness.screws import screw_map

if TYPE_CHECKING:
    import pandas
    import xarray

_NULL = 1e-12  # [-] tolerance for zero eigenvalues, relative to the largest
_ROUNDING = 1e-14  # [-] round-off in the mass matrix, relative to its largest entry


@dataclass(frozen=True, eq=False)
class NaturalModes:
    """Natural modes of a robot in ascending order of frequency.

    Attributes:
        posture: the robot's nominal configuration.
        frequencies: (k,) [Hz] natural frequencies; 0 for motions without resistance,
            NaN for unstable modes.
        platform_screws: (6, k) [rad, m] platform motions, normalised to a modal mass of
            1 kg.
        shares: for each mode, the energy shares of links and joints in descending
            order; empty without elastic energy.
        idle: number of free motions that do not move the platform, such as the spin of
            a rod between two ball joints.  They are not included in the modes.
        method: method of the equilibrium, ``"compiled"`` or ``"reference"``.
    """

    posture: Posture
    frequencies: NDArray
    platform_screws: NDArray
    shares: tuple[dict[Part, float], ...]
    idle: int
    method: Method

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set with the dimension ``mode``; see :mod:`.tables`."""
        from forcefit.assembly.platform_stiffness.tables import modes_dataset

        return modes_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with a row for each mode."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "mode")


@renamed_keywords(exact=("state", {True: "exact", False: "nominal"}))
def natural_modes(
    posture: Posture,
    count: int = 6,
    load: Load | None = None,
    gravity: ArrayLike | None = None,
    state: Literal["nominal", "exact"] = "nominal",
    method: Method = "compiled",
) -> NaturalModes:
    """Compute the natural frequencies and modes of a robot with fixed drives.

    Args:
        posture: the robot's configuration.
        count: maximum number of modes.
        load: (6,) [N m, N] wrench on the platform; or a mapping of components such as
            ``{"fz": -50}``.  The nominal state ignores it.
        gravity: (3,) [m/s^2] gravity vector.  The nominal state ignores it.
        state: ``"nominal"`` for the nominal robot with clearances fixed at zero, or
            ``"exact"`` for the equilibrium with errors, clearances and loads.
        method: method of :func:`forcefit.assembly.exact.exact.solve_exact`.

    Returns:
        The modes.

    Raises:
        BadInput: no moving body has a mass.
        CannotAssemble: the loops cannot be closed with these errors.
        FreeMotion: a load acts on a motion without stiffness.
        SolverFailed: no equilibrium was found.
        ValueError: ``state`` or ``method`` is unknown.
    """
    return _solved_modes(posture, count, load, gravity, state, method)[0]


def discretisation_errors(
    modes: NaturalModes,
    load: Load | None = None,
    gravity: ArrayLike | None = None,
    state: Literal["nominal", "exact"] = "nominal",
) -> NDArray:
    """Estimate the errors of frequencies due to the cubic shape of vibrating beams.

    The frequencies are computed again with twice the number of elements of every beam
    with a density.  The error due to bending is of fourth order in the element length,
    so it is 16/15 of the difference.  The error due to longitudinal and torsional waves
    is of second order and is computed from the mode.

    Args:
        modes: modes of the robot.
        load: load of :func:`natural_modes`.
        gravity: gravity of :func:`natural_modes`.
        state: state of :func:`natural_modes`.

    Returns:
        Relative errors (k,); 0 without such beams.  An error is NaN if the frequency is
        0 or NaN in one of the two computations.  All errors are NaN if a mesh link has
        a density, because the error of its condensed mass is unknown.

    Raises:
        CannotAssemble: as in :func:`natural_modes`.
        FreeMotion: as in :func:`natural_modes`.
        SolverFailed: as in :func:`natural_modes`.
    """
    robot = modes.posture.robot
    vibrating: dict[str, Link] = {
        f.name: replace(f.link, pieces=2 * f.link.pieces)
        for f in robot.frames
        if isinstance(f.link, BeamLink) and f.link.density is not None
    }
    coarse = modes.frequencies
    if any(isinstance(f.link, MeshLink) and f.link.density for f in robot.frames):
        return np.full(len(coarse), np.nan)
    errors = np.where(coarse > 0.0, 0.0, np.nan)
    if vibrating:
        posture = replace(modes.posture, robot=robot.with_links(vibrating))
        fine, equilibrium, x = _solved_modes(
            posture, len(coarse), load, gravity, state, modes.method
        )
        waves = 0.5 * np.sum(x * (_wave_mass(equilibrium) @ x), axis=0)
        limit = fine.frequencies
        both = np.flatnonzero((coarse > 0.0) & (limit[: len(coarse)] > 0.0))
        errors = np.full(len(coarse), np.nan)
        errors[both] = 16 / 15 * (coarse[both] / limit[both] - 1.0) + 0.8 * waves[both]
    return errors


def _solved_modes(
    posture: Posture,
    count: int,
    load: Load | None,
    gravity: ArrayLike | None,
    state: Literal["nominal", "exact"],
    method: Method,
) -> tuple[NaturalModes, ExactAssembly, NDArray]:
    """Return the modes, the equilibrium, and the modes in its unknowns (N, k)."""
    if state not in {"nominal", "exact"}:
        raise ValueError(
            f"natural_modes: found state {state!r}, expected 'nominal' or 'exact'"
        )
    if state == "nominal":
        # the nominal state ignores loads, including drive forces
        frames = (
            replace(f, clearance=None, drive_force=0.0) for f in posture.robot.frames
        )
        tight = replace(posture.robot, frames=tuple(frames))
        posture = replace(posture, robot=tight.with_errors(0 * tight.errors))
        load = gravity = None
    equilibrium = solve_exact(posture, load, gravity=gravity, method=method)
    D, H = tangent_space(equilibrium.expansion)
    mass = mass_matrix(equilibrium)
    M, rounding = D.T @ mass @ D, _ROUNDING * np.abs(mass).max(initial=0.0) * (D.T @ D)
    if not np.trace(M) > 0.0:
        raise BadInput(_no_mass(posture.robot))
    squares, modes = _modes(H, M, rounding)
    if not squares.size:  # the mass of the moving bodies is round-off
        raise BadInput(_no_mass(posture.robot))
    squares, modes, idle = _without_idle(
        squares, modes, platform_moves(equilibrium.expansion) @ D
    )
    squares, x = squares[:count], D @ modes[:, :count]
    with np.errstate(invalid="ignore"):
        frequencies = np.sqrt(squares) / (2 * np.pi)
    bent = x[equilibrium.expansion.placement.model.springs] * (squares != 0.0)
    modes_found = NaturalModes(
        posture, frequencies, platform_moves(equilibrium.expansion) @ x,
        tuple(_shares(part_owners(equilibrium), y) for y in bent.T), idle, method,
    )  # fmt: skip
    return modes_found, equilibrium, x


def check_masses(robot: Robot) -> None:
    """Raise BadInput if no body of a robot has a mass.

    Raises:
        BadInput: no body has a mass.
    """
    shapes = (f.link for f in robot.frames if isinstance(f.link, BeamLink | MeshLink))
    rigid = any(f.mass or f.inertia.any() for f in robot.frames)
    if not rigid and not any(s.density for s in shapes):
        raise BadInput(_no_mass(robot))


def _no_mass(robot: Robot) -> str:
    """Return the error message for a robot without masses."""
    return (
        f'{robot.name}: found no moving mass; expected "density" of beams or '
        'meshes, or "mass" or "inertia" of frames'
    )


def _without_idle(
    squares: NDArray, modes: NDArray, moves: NDArray
) -> tuple[NDArray, NDArray, int]:
    """Remove and count the free motions that do not move the platform."""
    free = squares == 0.0
    if not free.any():
        return squares, modes, 0
    _, S, Vt = np.linalg.svd(moves @ modes[:, free])
    moved = int(np.sum(S > 1e-6 * np.linalg.norm(moves @ modes, axis=0).max()))
    turned = modes.copy()
    turned[:, free] = modes[:, free] @ Vt.T
    kept = ~free
    kept[np.flatnonzero(free)[:moved]] = True
    return squares[kept], turned[:, kept], int(free.sum()) - moved


def _modes(K: NDArray, M: NDArray, rounding: NDArray) -> tuple[NDArray, NDArray]:
    """Return squared angular frequencies in ascending order, and normalised modes.

    Args:
        K: (k, k) stiffness matrix.
        M: (k, k) mass matrix.
        rounding: (k, k) bound on the round-off in M, a quadratic form.

    Returns:
        (m,) squared frequencies and (k, m) modes.
    """
    # the shift is 1 for a robot without elastic parts
    shift = np.trace(K) / np.trace(M) or 1.0
    values, vectors = np.linalg.eigh(K + shift * M)
    least = shift * np.sum(vectors * (rounding @ vectors), axis=0)
    # omit motions without mass and stiffness
    kept = values > np.maximum(_NULL * values.max(), least)
    if not kept.any():
        return np.zeros(0), np.zeros((len(K), 0))
    basis = vectors[:, kept] / np.sqrt(values[kept])
    inertia, turned = np.linalg.eigh(basis.T @ M @ basis)
    noise = np.sum(turned * (basis.T @ rounding @ basis @ turned), axis=0)
    heavy = inertia > np.maximum(_NULL * inertia.max(), noise)
    inertia, turned = inertia[heavy][::-1], turned[:, heavy][:, ::-1]
    squares = 1.0 / inertia - shift
    squares[np.abs(squares) < 1e-9 * shift] = 0.0
    return squares, basis @ turned / np.sqrt(inertia)


def _shares(parts: tuple[Part, ...], springs: NDArray) -> dict[Part, float]:
    """Return the energy shares of links and joints in descending order."""
    energies: dict[Part, float] = {}
    for part, y in zip(parts, springs, strict=True):
        energies[part] = energies.get(part, 0.0) + float(y) ** 2
    whole = sum(energies.values())
    if not whole:
        return {}
    order = sorted(energies, key=lambda part: -energies[part])
    return {part: energies[part] / whole for part in order}


def mass_matrix(equilibrium: ExactAssembly) -> NDArray:
    """Return the mass matrix for the unknowns of an equilibrium.

    Args:
        equilibrium: equilibrium of the robot.

    Returns:
        (N, N) [kg m^2 per squared unit] symmetric, positive semidefinite matrix.
    """
    placement, robot = equilibrium.placement, equilibrium.cut.robot
    M = np.zeros((len(placement.x), len(placement.x)))
    for i, frame in enumerate(robot.frames):
        T = placement.body_ends[i]
        tip = _body_motion(equilibrium, i)
        if frame.mass:
            centre = T[:3, 3] + T[:3, :3] @ frame.centre_of_mass
            moved = (screw_map(equilibrium.posture.platform[:3, 3] - centre) @ tip)[3:]
            M += frame.mass * moved.T @ moved
        if frame.inertia.any():
            R = T[:3, :3]
            M += tip[:3].T @ (R @ frame.inertia @ R.T) @ tip[:3]
        link = frame.link
        if isinstance(link, BeamLink) and link.density is not None:
            B = _beam_ends(equilibrium, i)
            M += B.T @ _beam_mass(frame) @ B
        elif isinstance(link, MeshLink) and link.density is not None:
            inertia, span = mesh_link_mass(frame)
            B = _ends(equilibrium, i, tip, span, np.eye(3))
            M += B.T @ inertia @ B
    return M


def _wave_mass(equilibrium: ExactAssembly) -> NDArray:
    """Return the change of mass that cancels the second-order error of waves.

    Half of its quadratic form for a mode of modal mass 1 is the relative error of the
    frequency, because the mean of the consistent and the lumped mass of a rod is exact
    to fourth order.

    Args:
        equilibrium: equilibrium of the robot.

    Returns:
        (N, N) [kg m^2 per squared unit] symmetric, positive semidefinite matrix.
    """
    size = len(equilibrium.placement.x)
    M = np.zeros((size, size))
    for i, frame in enumerate(equilibrium.cut.robot.frames):
        link = frame.link
        if isinstance(link, BeamLink) and link.density is not None:
            B = _beam_ends(equilibrium, i)
            mass = _beam_mass(frame)
            for base, tip in ((0, 6), (3, 9)):
                strain = B[tip] - B[base]
                M += mass[base, base] / 4 * np.outer(strain, strain)
    return M


def _body_motion(equilibrium: ExactAssembly, i: int) -> NDArray:
    """Return the small motion of body i per unit of each unknown, (6, N).

    The reference point is the nominal origin of the platform.
    """
    model = equilibrium.placement.model
    above = equilibrium.cut.robot.on_path[i].copy()
    above[i] = False
    own = (model.frame == i) & (model.motion == LINK)
    return equilibrium.placement.moves * (above[model.frame] | own)


def _beam_ends(equilibrium: ExactAssembly, i: int) -> NDArray:
    """Return the small motions of both ends of beam i, in the axes of its section."""
    frame = equilibrium.cut.robot.frames[i]
    assert isinstance(frame.link, BeamLink)
    length, axis = beam_axis(frame)
    axes = section_axes(axis, frame.link.up)
    return _ends(equilibrium, i, _body_motion(equilibrium, i), length * axis, axes)


def _ends(
    equilibrium: ExactAssembly, i: int, tip: NDArray, span: NDArray, axes: NDArray
) -> NDArray:
    """Return the small motions of both ends of a link.

    Args:
        equilibrium: equilibrium of the robot.
        i: index of the link's frame.
        tip: (6, N) motion of the body's end, at the platform's nominal origin.
        span: (3,) [m] vector from base to tip, in the frame's axes.
        axes: (3, 3) axes of the returned motions, as a rotation from the frame's axes.

    Returns:
        (12, N) rotations and translations of the base, then those of the tip.
    """
    placement, robot = equilibrium.placement, equilibrium.cut.robot
    above = robot.on_path[i].copy()
    above[i] = False
    base = placement.moves * above[placement.model.frame]
    T = placement.body_ends[i]
    turned = T[:3, :3] @ axes
    origin = equilibrium.posture.platform[:3, 3]
    start = T[:3, 3] - T[:3, :3] @ span
    ends = []
    for place, motion in ((start, base), (T[:3, 3], tip)):
        read = screw_map(origin - place) @ motion
        ends += [turned.T @ read[:3], turned.T @ read[3:]]
    return np.vstack(ends)


def _beam_mass(frame: Frame) -> NDArray:
    """Return the consistent mass matrix of a beam, (12, 12)."""
    link = frame.link
    assert isinstance(link, BeamLink)
    assert link.density is not None
    length, _ = beam_axis(frame)
    section = declared_section(link.section, link.poisson)
    mass = link.density * section.area * length
    M = np.zeros((12, 12))
    turning = link.density * (section.I_y + section.I_z) * length
    for rows, size in (((3, 9), mass), ((0, 6), turning)):
        M[np.ix_(rows, rows)] += size / 6 * np.array([[2, 1], [1, 2]])
    a, b, c, d = 22 * length, 13 * length, 4 * length**2, 3 * length**2
    e, f, g = 3 * length, 4 * length**2, length**2
    bends = ((4, 2, 10, 8), 1, section.I_z), ((5, 1, 11, 7), -1, section.I_y)
    for plane, sign, second in bends:
        # a positive rotation about y moves points with x > 0 in the direction -z
        s = np.array([1, sign, 1, sign])
        shift = np.array([
            [156, a, 54, -b], [a, c, b, -d], [54, b, 156, -a], [-b, -d, -a, c]
        ])  # fmt: skip
        turn = np.array([
            [36, e, -36, e], [e, f, -e, -g], [-36, -e, 36, -e], [e, -g, -e, f]
        ])  # fmt: skip
        block = mass / 420 * shift + link.density * second / (30 * length) * turn
        M[np.ix_(plane, plane)] += block * np.outer(s, s)
    return M
