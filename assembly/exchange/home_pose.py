"""Search for a home pose with closed loops near the home pose of the file."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.coupling import Coupling
from forcefit.assembly.exchange.mechanism import (
    Mechanism,
)
from forcefit.assembly.exchange.orientation import onto
from forcefit.assembly.exchange.tree import place_frames
from forcefit.inputs.errors import BadInput, quoted
from forcefit.stiffness.screws import rotation_vector, skew, transform

CLOSED = 1e-10  # [rad, m] largest mismatch of a closed loop
_SCREWED_TIGHT = 1e-14  # scaled loop mismatch at machine precision
_STARTS = 20  # number of random starting points for all loops together
_STARTS_ALONE = 12  # number of random starting points for a single loop
_STEPS = 200  # maximum number of iterations per start
_LONGEST_STEP = 0.3  # [rad, or fraction of the robot size] maximum step length
# a search stops if ten iterations reduce the sum of squares to more than this fraction
_STALLED = 0.999


def loop_residual(mechanism: Mechanism, coordinates: NDArray) -> float:
    """Return the largest component of the loop mismatches [rad, m]."""
    residual = _Loops(mechanism, 1.0).equations(coordinates)[0]
    return float(np.abs(residual).max(initial=0.0))


def close_loops(mechanism: Mechanism, file: str) -> tuple[NDArray, bool]:
    """Find joint coordinates that close all loops, near the coordinates of the file.

    In the first search, the drive coordinates are fixed.  If it fails, the drive
    coordinates are varied as well, first from the coordinates of the file and then from
    random starting points at increasing distances.  The random starting points are the
    same in each call.

    Args:
        mechanism: mechanism with n joints.
        file: name of the file, for error messages.

    Returns:
        Coordinates (n,) [rad or m], and whether the drive coordinates of the file are
        unchanged.

    Raises:
        BadInput: no search closes the loops.
    """
    coordinates, residual, held = nearest_closed(mechanism, 0)
    if residual >= CLOSED:
        for loop in mechanism.loops:
            _check_alone(replace(mechanism, loops=(loop,)), file)
        coordinates, residual, held = nearest_closed(mechanism, _STARTS)
    if residual >= CLOSED:
        raise BadInput(
            f"{file}: its {len(mechanism.loops)} loops cannot be closed together: "
            f"the smallest gap found is {residual:.3g} rad or m; check the lengths "
            "and the loop types 6d and 3d (--points)"
        )
    return coordinates, held


def _check_alone(mechanism: Mechanism, file: str) -> None:
    """Check that the only loop of a mechanism can be closed."""
    (loop,) = mechanism.loops
    residual = nearest_closed(mechanism, _STARTS_ALONE)[1]
    if residual >= CLOSED:
        ends = f"({quoted(loop.first)}, {quoted(loop.second)})"
        raise BadInput(
            f"{file}: {loop.name} {ends} cannot be closed even without the "
            f"other loops: the smallest gap found is {residual:.3g} rad or m; expected "
            "more joints, or type 3d (--points)"
        )


def nearest_closed(mechanism: Mechanism, starts: int) -> tuple[NDArray, float, bool]:
    """Find coordinates with minimum loop mismatch, near the coordinates of the file.

    Args:
        mechanism: mechanism with n joints.
        starts: number of random starting points.

    Returns:
        Coordinates (n,) [rad or m], their loop mismatch [rad, m], and whether the drive
        coordinates of the file are unchanged.
    """
    loops = _Loops(mechanism, _size(mechanism))
    coordinates, residual, held = mechanism.home, np.inf, True
    for attempt, hold in _attempts(mechanism, starts):
        tried = _solve(loops, attempt, hold)
        left = loop_residual(mechanism, tried)
        if left < 0.5 * residual:
            coordinates, residual, held = tried, left, hold
        if residual < CLOSED:
            break
    return coordinates, residual, held


def _attempts(mechanism: Mechanism, starts: int) -> Iterator[tuple[NDArray, bool]]:
    """Yield starting points, and whether the drive coordinates are fixed."""
    start = mechanism.home
    yield start, True
    yield start, False
    random = np.random.default_rng(0)
    kinds = np.array([joint.kind for joint in mechanism.joints])
    reach = np.where(np.isin(kinds, ["revolute", "helical"]), np.pi, _size(mechanism))
    for count in range(1, starts + 1):
        spread = reach * random.uniform(-1, 1, len(start)) * count / starts
        yield start + spread, False


def _solve(loops: "_Loops", start: NDArray, hold: bool) -> NDArray:
    """Run a Levenberg-Marquardt search from one starting point."""
    followers = [follower for follower, *_ in loops.coupled]
    driven = loops.actuated.copy()
    driven[followers] = False  # leaders determine the coordinates of followers
    free = loops.moving & loops.concerned & ~(hold & driven)
    unit = np.where(loops.kinds == 2, loops.size, 1.0)
    q, damping = start.astype(float), 1e-3
    r, J = loops.equations(q)
    before = np.inf
    for step in range(_STEPS):
        if np.abs(r).max(initial=0.0) < _SCREWED_TIGHT or not free.any():
            break
        if step % 10 == 0:
            if r @ r > _STALLED * before:
                break
            before = r @ r
        A = (J * unit)[:, free]
        # damping in additional rows avoids squaring the condition number
        damped = np.vstack([A, np.sqrt(damping) * np.eye(A.shape[1])])
        x = np.linalg.lstsq(damped, np.append(r, np.zeros(A.shape[1])), rcond=None)[0]
        x *= min(1.0, _LONGEST_STEP / max(np.abs(x).max(initial=0.0), 1e-300))
        tried = q.copy()
        tried[free] -= x * unit[free]
        r_tried, J_tried = loops.equations(tried)
        if r_tried @ r_tried < r @ r:
            q, r, J = tried, r_tried, J_tried
            damping = max(damping / 10, 1e-20)
        elif damping > 1e6:
            break
        else:
            damping *= 10
    return q


def _size(mechanism: Mechanism) -> float:
    """Return the largest distance between neighbouring joints [m]; 1 if it is zero."""
    lengths = [np.linalg.norm(joint.placement[:3, 3]) for joint in mechanism.joints]
    return float(max(lengths, default=0.0)) or 1.0


@dataclass(frozen=True, eq=False)
class _Loops:
    """Closure equations of the loops and equations of the coupled joints.

    All joints rotate about or translate along their own z axes.
    """

    mechanism: Mechanism
    size: float

    @cached_property
    def kinds(self) -> NDArray:
        """Type of each joint, (n,): 0 fixed, 1 revolute or helical, 2 prismatic."""
        kinds = {"fixed": 0, "revolute": 1, "helical": 1, "prismatic": 2}
        return np.array([kinds[j.kind] for j in self.mechanism.joints], int)

    @cached_property
    def leads(self) -> NDArray:
        """Leads of helical joints, (n,) [m/rad]; 0 for other joints."""
        return np.array([j.lead for j in self.mechanism.joints], float)

    @property
    def moving(self) -> NDArray:
        """Whether each joint is movable, (n,)."""
        return self.kinds > 0

    @cached_property
    def actuated(self) -> NDArray:
        """Whether each joint is driven, (n,)."""
        return np.array([j.actuated for j in self.mechanism.joints], dtype=bool)

    @cached_property
    def tree(self) -> tuple[NDArray, NDArray, dict[str, tuple[int, NDArray]]]:
        """Tree of joints with the z axis along each joint axis.

        The tree consists of the parent of each joint, (n,), the pose of each joint
        relative to its parent, (n, 4, 4), and the joint and pose of each body.
        """
        on: dict[str, tuple[int, NDArray]] = {self.mechanism.root: (-1, np.eye(4))}
        parents, fixed = [], []
        for row, joint in enumerate(self.mechanism.joints):
            parent, at = on[joint.parent]
            turn = transform(np.zeros(3), onto(joint.axis))
            parents.append(parent)
            fixed.append(at @ joint.placement @ turn)
            on[joint.child] = row, turn.T @ joint.after
        count = len(parents)
        return np.array(parents, int), np.array(fixed).reshape(count, 4, 4), on

    @cached_property
    def ends(self) -> list[tuple[tuple[int, NDArray], tuple[int, NDArray], NDArray]]:
        """Joint and pose of both ends of each loop, and its constrained components."""
        on, places = self.tree[2], []
        for loop in self.mechanism.loops:
            (i, A), (j, B) = on[loop.first], on[loop.second]
            rows = np.arange(3 if loop.point else 0, 6)
            places.append(((i, A @ loop.at_first), (j, B @ loop.at_second), rows))
        return places

    @cached_property
    def carried(self) -> NDArray:
        """Mask of the joints that move each body, (n + 1, n); the last row is zero."""
        parents = self.tree[0]
        marks = np.zeros((len(parents) + 1, len(parents)))
        for i, parent in enumerate(parents):
            marks[i] = marks[parent]
            marks[i, i] = 1.0
        return marks

    @cached_property
    def concerned(self) -> NDArray:
        """Whether the motion of each joint affects a loop mismatch, (n,)."""
        marks = np.zeros(len(self.kinds), dtype=bool)
        for (i, _), (j, _), _ in self.ends:
            marks |= self.carried[i] != self.carried[j]
        # in the list of couplings, leaders precede their followers
        for follower, leader, _ in reversed(self.coupled):
            if leader >= 0:
                marks[leader] |= marks[follower]
        for follower, leader, _ in self.coupled:
            marks[follower] |= leader >= 0 and marks[leader]
        return marks

    @cached_property
    def coupled(self) -> list[tuple[int, int, Coupling]]:
        """Indices of follower and leader, and their coupling.

        The index is -1 if there is no leader.
        """
        row = {joint.name: k for k, joint in enumerate(self.mechanism.joints)}
        return [
            (row[one.follower], row.get(one.leader or "", -1), one)
            for one in self.mechanism.couplings
        ]

    def equations(self, q: NDArray) -> tuple[NDArray, NDArray]:
        """Return the residuals of all equations and their Jacobian.

        Translations are divided by the robot size.
        """
        parents, fixed, _ = self.tree
        before, after = place_frames(parents, self.kinds, fixed, q, self.leads)
        p = before[:, :3, 3]
        z = before[:, :3, 2] * self.moving[:, None]
        turning = (self.kinds == 1)[:, None]
        past_axes = np.cross(z, p) - self.leads[:, None] * z
        scale = np.array([1, 1, 1, *[1 / self.size] * 3])
        residuals, rows = [np.zeros(0)], [np.zeros((0, len(q)))]
        for *places, asked in self.ends:
            poses, moved = [], []
            for joint, place in places:
                T = place if joint < 0 else after[joint] @ place
                # a joint at p moves the origin of T by z x (origin - p), and a helical
                # joint also along z
                arm = np.where(turning, z @ skew(T[:3, 3]) - past_axes, z)
                screws = np.concatenate([z * turning, arm], axis=1)
                poses.append(T)
                moved.append(screws.T * self.carried[joint])
            A, B = poses
            turn = rotation_vector(A[:3, :3] @ B[:3, :3].T)
            r = np.concatenate([turn, A[:3, 3] - B[:3, 3]]) * scale
            residuals.append(r[asked])
            rows.append(((moved[0] - moved[1]) * scale[:, None])[asked])
        for follower, leader, rule in self.coupled:
            value, slope = rule.at(float(q[leader]) if leader >= 0 else 0.0)
            row = np.zeros(len(q))
            row[follower] = 1.0
            if leader >= 0:
                row[leader] -= slope
            unit = self.size if self.kinds[follower] == 2 else 1.0
            residuals.append(np.array([q[follower] - value]) / unit)
            rows.append(row[None] / unit)
        return np.concatenate(residuals), np.vstack(rows)
