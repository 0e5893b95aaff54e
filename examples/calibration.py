"""Geometric errors and further effects of a serial robot, from measured poses.

The paper's geometric errors delta l, one small screw at every frame, are unknown all at
once, beside effects given by their signatures and one base pose for each group of rows.
The model is the library's own: frames from ``assembly.kinematics.nominal``, paths M_j
(eq. 14) as derivatives, forces from ``assembly.linear.load``.  After each step the
errors found are built into the frames, so the answer is that of the finite geometry.

Frames are over-complete (some errors cannot be told apart), so every unknown has a
prior spread; what the data do not see stays at zero.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.nominal import Target, follow
from assembly.kinematics.posture import Posture, home_posture
from assembly.linear.load import loads_on_frames, weights
from assembly.measurement.conditions import Conditions, as_declared
from assembly.model.robot import Robot
from examples.campaign_folder import base_pose
from stiffness.screws import rotation_matrix, rotation_vector, screw_map, transform
from validation.campaign.campaign import Campaign


@dataclass(frozen=True, eq=False)
class Rows:
    """What was measured, with the robot that is thought to have been there.

    Attributes:
        here: conditions of k rows: robot, coordinates, frames, gravity.
        pose: (k, 4, 4) measured platform, in axes of the device.
        sigma: (k, 6) [rad, m] of each component; inf = not measured.
        group: (k,) number of the base pose the row belongs to.
        covariates: columns (k,) by name.
    """

    here: Conditions
    pose: NDArray
    sigma: NDArray
    group: NDArray
    covariates: dict[str, NDArray]

    def __len__(self) -> int:
        return len(self.pose)

    def take(self, which: NDArray) -> "Rows":
        """Some of the rows."""
        return Rows(
            self.here.take(which), self.pose[which], self.sigma[which],
            self.group[which], {k: v[which] for k, v in self.covariates.items()},
        )  # fmt: skip

    def of(self, robot: Robot) -> "Rows":
        """The same commands given to another robot of the same frames."""
        q = self.here.coordinates
        start = home_posture(robot).coordinates
        track = follow(robot, start, Target(coordinates=q), guess=True)
        errors = np.broadcast_to(robot.errors, self.here.errors.shape)
        moved = replace(
            self.here, robot=robot, transforms=track.transforms, errors=errors
        )
        return replace(self, here=moved)

    @property
    def platform(self) -> NDArray:
        """(k, 4, 4) nominal platform."""
        return self.here.postures.platform

    def joint_wrenches(self) -> NDArray:
        """(k, n, 6) [N m, N] through each joint under gravity, frame axes."""
        postures = self.here.postures
        bodies, carried = weights(postures, self.here.gravity)
        forces = loads_on_frames(postures, None, bodies, carried)
        return forces.joint.reshape(len(self), -1, 6)

    def turned_about(self, point: NDArray, axes: NDArray) -> NDArray:
        """(k, 6, 3) platform screws of unit turns about a point's three axes.

        ``point`` (k, 3) [m] and ``axes`` (k, 3, 3), both seen from the base.
        """
        return screw_map(point - self.platform[:, :3, 3], axes)[:, :, :3]


Signature = Callable[[Rows], NDArray]


@dataclass(frozen=True, eq=False)
class Term:
    """Unknowns beside geometric errors: a platform screw linear in them.

    Attributes:
        names: of the m unknowns.
        prior: (m,) their prior spread.
        signature: (k, 6, m) platform screws of unit values, base axes.
    """

    names: tuple[str, ...]
    prior: NDArray
    signature: Signature


@dataclass(frozen=True, eq=False)
class Fit:
    """A calibrated robot.

    Attributes:
        robot: its frames moved to where they were found.
        terms: those that were fitted.
        values: (m,) of all the terms' unknowns.
        std: (m,) one sigma of them.
        bases: (groups, 4, 4) base frames seen from the device.
    """

    robot: Robot
    terms: tuple[Term, ...]
    values: NDArray
    std: NDArray
    bases: NDArray

    def named(self) -> dict[str, tuple[float, float]]:
        """Value and sigma of the terms' unknowns."""
        names = [name for term in self.terms for name in term.names]
        pairs = zip(self.values.tolist(), self.std.tolist(), strict=True)
        return dict(zip(names, pairs, strict=True))


def rows_of(campaign: Campaign, gravity: NDArray, group: NDArray | None = None) -> Rows:
    """The rows of a campaign whose platform is the point that was measured.

    Args:
        campaign: of k rows; the deviations are put back onto the nominal poses.
        gravity: (3,) or (k, 3) [m/s^2] base axes.
        group: (k,) numbers of base poses; one for all if absent.

    Returns:
        The rows.

    Raises:
        ValueError: the reference point is not the platform's origin.
    """
    if campaign.reference_point.any():
        raise ValueError("rows_of: expected the reference point (0, 0, 0)")
    q, T = campaign.coordinates, campaign.transforms
    here = as_declared(Posture(campaign.robot, q, T, 0.0), gravity=gravity)
    deviation = np.where(campaign.cells, campaign.measured, 0.0)
    pose = here.postures.platform.copy()
    pose[:, :3, :3] = rotation_matrix(deviation[:, :3]) @ pose[:, :3, :3]
    pose[:, :3, 3] += deviation[:, 3:]
    sigma = np.where(campaign.cells, campaign.sigma, np.inf)
    group = np.zeros(len(campaign), dtype=int) if group is None else group
    return Rows(here, pose, sigma, group, dict(campaign.covariates))


def joint_springs(names: dict[str, str], prior: float) -> Term:
    """Compliances of joints [rad/(N m)] under gravity.

    Args:
        names: of frames, each with the axes about which it gives, such as ``"z"``.
        prior: [rad/(N m)] spread.

    Returns:
        The term; its unknowns are named ``<frame>.<axis>``.
    """
    pairs = [(frame, "xyz".index(a)) for frame, axes in names.items() for a in axes]

    def signature(rows: Rows) -> NDArray:
        robot = rows.here.robot
        at = [robot.index(frame) for frame, _ in pairs]
        axis = [a for _, a in pairs]
        paths = rows.here.postures.paths[:, at, :, axis]  # (m, k, 6)
        moments = rows.joint_wrenches()[:, at, axis]  # (k, m)
        return np.einsum("mki,km->kim", paths, moments)

    labels = tuple(f"{frame}.{'xyz'[a]}" for frame, a in pairs)
    return Term(labels, np.full(len(pairs), prior), signature)


def residuals(fit: Fit, rows: Rows) -> NDArray:
    """(k, 6) [rad, m] measured minus predicted platform screw, device axes."""
    rows = rows.of(fit.robot)
    return _residuals(rows, _signatures(rows, fit.terms) @ fit.values, fit.bases)


def calibrate(
    rows: Rows,
    free: NDArray,
    terms: tuple[Term, ...] = (),
    known: Fit | None = None,
    iterations: int = 5,
) -> Fit:
    """Geometric errors and terms that explain the rows best, with their base poses.

    Args:
        rows: with the robot where it was thought to be.
        free: (n, 6) [rad, m] prior spread of each frame's geometric error; 0 = none.
        terms: further unknowns.
        known: an earlier fit: its robot is started from, its terms stay as they are.
        iterations: of Gauss-Newton.

    Returns:
        The fit.
    """
    held = () if known is None else known.terms
    fixed, spread = (np.zeros(0),) * 2 if known is None else (known.values, known.std)
    robot = rows.here.robot if known is None else known.robot
    chosen = np.argwhere(free > 0)
    prior = np.concatenate([free[free > 0], *(t.prior for t in terms)])
    found, std = np.zeros((2, len(prior)))
    bases = _first_bases(rows.of(robot))
    for _ in range(iterations):
        at = rows.of(robot)
        signatures = _signatures(at, terms)
        screws = _signatures(at, held) @ fixed + signatures @ found[len(chosen) :]
        r = _residuals(at, screws, bases)
        R = bases[at.group][:, :3, :3]
        paths = at.here.postures.paths[:, chosen[:, 0], :, chosen[:, 1]]
        own = np.concatenate([paths.transpose(1, 2, 0), signatures], axis=2)
        J = np.concatenate([_turned(R, own), _base_columns(at, bases)], axis=2)
        step, std = _step(J, r, at.sigma, prior, found)
        own_step, base_step = np.split(step, [len(prior)])
        found = found + own_step
        delta = np.zeros(free.shape)
        delta[free > 0] = own_step[: len(chosen)]
        robot, bases = _rebuilt(robot, delta), _moved(bases, base_step)
    values = np.concatenate([fixed, found[len(chosen) :]])
    return Fit(
        robot, (*held, *terms), values,
        np.concatenate([spread, std[len(chosen) : len(prior)]]), bases,
    )  # fmt: skip


def _step(
    J: NDArray, r: NDArray, sigma: NDArray, prior: NDArray, found: NDArray
) -> tuple[NDArray, NDArray]:
    """Gauss-Newton step and one sigma; the prior holds all that was found so far."""
    w = 1.0 / sigma
    A = (J * w[..., None]).reshape(-1, J.shape[-1])
    normal, right = A.T @ A, A.T @ (r * w).ravel()
    known = np.arange(len(prior))
    normal[known, known] += prior**-2
    right[known] -= found * prior**-2
    scale = 1.0 / np.sqrt(np.diag(normal))
    covariance = np.linalg.inv(normal * np.outer(scale, scale))
    return scale * (covariance @ (scale * right)), scale * np.sqrt(np.diag(covariance))


def _signatures(rows: Rows, terms: tuple[Term, ...]) -> NDArray:
    """(k, 6, m) of all terms."""
    none = np.zeros((len(rows), 6, 0))
    return np.concatenate([none, *(t.signature(rows) for t in terms)], axis=2)


def _residuals(rows: Rows, screws: NDArray, bases: NDArray) -> NDArray:
    """(k, 6) measured minus predicted, device axes, zero where not measured."""
    B = bases[rows.group]
    T = B @ rows.platform
    moved = _turned(B[:, :3, :3], screws[..., None])[..., 0]
    there = rotation_matrix(moved[:, :3]) @ T[:, :3, :3]
    turn = rotation_vector(rows.pose[:, :3, :3] @ np.swapaxes(there, 1, 2))
    shift = rows.pose[:, :3, 3] - T[:, :3, 3] - moved[:, 3:]
    r = np.concatenate([turn, shift], axis=1)
    return np.where(np.isfinite(rows.sigma), r, 0.0)


def _turned(R: NDArray, screws: NDArray) -> NDArray:
    """(k, 6, m) screws in other axes, R (k, 3, 3)."""
    return np.concatenate([R @ screws[:, :3], R @ screws[:, 3:]], axis=1)


def _base_columns(rows: Rows, bases: NDArray) -> NDArray:
    """(k, 6, 6 groups) platform screws of small motions of the bases, device axes."""
    R = bases[rows.group][:, :3, :3]
    arm = np.einsum("kij,kj->ki", R, rows.platform[:, :3, 3])
    columns = np.zeros((len(rows), 6, len(bases), 6))
    columns[np.arange(len(rows)), :, rows.group] = screw_map(-arm)
    return columns.reshape(len(rows), 6, -1)


def _moved(bases: NDArray, steps: NDArray) -> NDArray:
    """Bases after small screws in device axes, read at each base's origin."""
    s = steps.reshape(-1, 6)
    turned = rotation_matrix(s[:, :3]) @ bases[:, :3, :3]
    return transform(bases[:, :3, 3] + s[:, 3:], turned)


def _rebuilt(robot: Robot, errors: NDArray) -> Robot:
    """The robot with small screws built into the places of its frames."""
    frames = []
    for frame, e in zip(robot.frames, errors, strict=True):
        R = rotation_matrix(frame.rotation)
        where = frame.translation + R @ e[3:]
        turned = rotation_vector(R @ rotation_matrix(e[:3]))
        frames.append(replace(frame, translation=where, rotation=turned))
    return replace(robot, frames=tuple(frames))


def _first_bases(rows: Rows) -> NDArray:
    """(groups, 4, 4) base poses from positions alone."""
    groups = range(int(rows.group.max()) + 1)
    mine = [rows.group == g for g in groups]
    return np.array([base_pose(rows.platform[m], rows.pose[m]) for m in mine])
