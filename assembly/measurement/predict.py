"""What a measuring device reads: the platform's deviation, row by row of conditions.

Robots without play are solved together (:mod:`assembly.linear.without_clearance`, with
finite motions :mod:`assembly.measurement.exact_rows`); rows with play, or whose
closures' rank is in doubt, go through :mod:`assembly.linear.energy` and
:mod:`assembly.exact.exact` one by one.

Sources:
    Public format, campaigns: rotation vector of R_actual R_nominal^T and difference of
    the reference point's position, base axes.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.exact.exact import ExactAssembly, solve_exact
from assembly.kinematics.posture import Posture
from assembly.linear.closure import virtual_joints
from assembly.linear.energy import Assembly, CannotAssemble, solve_assembly
from assembly.linear.load import row_forces
from assembly.linear.nearest_pose import nearest_pose
from assembly.linear.reduction import FreeMotion
from assembly.linear.without_clearance import flexibility, in_groups
from assembly.measurement.conditions import Conditions, ContactLaw
from assembly.measurement.exact_rows import solve_rows
from assembly.measurement.settled_clearance import at_rest, fractions, taken_up
from assembly.model.links import in_series, own_screw
from assembly.solvers.conic import SolverFailed
from stiffness.screws import rotation_matrix, rotation_vector

_STEPS = 100
_CORRECTED = 40  # configurations whose second order is found, of those one by one
_SETTLED = 1e-11  # relative change of a contact's deflection
_SETTLED_FINITE = 1e-5  # likewise, from the linear model's answer


@dataclass(frozen=True, eq=False)
class Prediction:
    """What R measurements should read.

    Attributes:
        deviation: (R, 6) [rad, m] rx ry rz tx ty tz, base axes; NaN without an answer.
        reason: (R,) why there is none, else empty.
        open: (R,) bool, play leaves the pose free: the one shown is, in a closed chain,
            the nearest to nominal, in an open one that of play in the middle.
    """

    deviation: NDArray
    reason: NDArray
    open: NDArray


def predict(here: Conditions) -> Prediction:
    """The platform's deviation from its nominal pose at the reference point.

    Args:
        here: R situations of a robot.

    Returns:
        What is read in each.
    """
    play = bool(virtual_joints(here.robot).cones.shape[1])
    open_ = np.zeros(len(here), dtype=bool)
    one_by_one = None
    if play and here.rest is not None:
        here = at_rest(here)
        # held play that finite motions cannot close has no answer one by one either
        one_by_one = 0 if here.exact else None
    elif play and not here.robot.closures and not here.exact:
        here, open_ = taken_up(here)
    screws, reason, left = _platform_screws(here, one_by_one)
    open_ |= left
    if not here.exact:
        screws = screws + here.second_order
    known = np.isfinite(screws).all(axis=1)
    deviation = np.full_like(screws, np.nan)
    if known.any():
        deviation[known] = read(here.take(known), screws[known])
    return Prediction(deviation, reason, open_)


def _platform_screws(
    here: Conditions, one_by_one: int | None = None
) -> tuple[NDArray, NDArray, NDArray]:
    """Platform screws, some rows one by one.

    Returns:
        (R, 6) the screws, (R,) why there are none, (R,) whether play leaves them free.
    """
    screws, open_ = np.full((len(here), 6), np.nan), np.zeros(len(here), dtype=bool)
    reason = np.full(len(here), "", dtype=object)
    left = np.ones(len(here), dtype=bool)
    if not virtual_joints(here.robot).cones.shape[1]:
        screws, solved = _without_play(here)
        left = ~solved
        screws[left], reason[left] = np.nan, "does not close together with others"
    for row in np.flatnonzero(left)[:one_by_one].tolist():
        try:
            answer, open_[row] = _settled(here, row)
            screws[row], reason[row] = answer.platform_screw, ""
        except (CannotAssemble, FreeMotion, SolverFailed) as error:
            screws[row], reason[row] = np.nan, str(error)
    return screws, reason, open_


def _settled(here: Conditions, row: int) -> tuple[Assembly | ExactAssembly, bool]:
    """One situation, play where the pose is nearest to nominal.

    With finite motions that is so of the linear answer from which they start.

    Returns:
        The assembly, and whether play leaves its pose free.
    """
    answer = assemble_row(here, row)
    offset = here.posture(row).platform[:3, :3] @ here.point
    if isinstance(answer, Assembly):
        return nearest_pose(answer, offset)
    start, open_ = nearest_pose(answer.linear, offset)
    if open_:
        gravity = here.gravity[row] if here.gravity[row].any() else None
        answer = solve_exact(
            start.posture, here.load[row], start, gravity=gravity, point=here.point
        )
    return answer, open_


def with_second_order(here: Conditions) -> Conditions:
    """Conditions whose linear answers carry what the declared errors do beyond it.

    Near a singularity a robot's own geometric errors move it so far that the linear
    model is wrong by more than a device's noise, whatever the load.  The difference of
    the exact and the linear platform screw without load is found once a configuration;
    effects of load stay linear.

    Args:
        here: R situations of a robot, as declared.

    Returns:
        The same, ``second_order`` given.
    """
    if virtual_joints(here.robot).cones.shape[1]:
        return here  # where play rests without load is open
    zero = np.zeros_like(here.load)
    _, which = in_groups(here.postures)
    _, first = np.unique(which, return_index=True)
    still = replace(here, load=zero, gravity=np.zeros_like(here.gravity), laws=())
    found = _finite_part(still.take(first), _CORRECTED)
    return replace(here, second_order=found[which])


def with_finite_motions(here: Conditions) -> Conditions:
    """Conditions whose linear answers carry all that finite motions add to them.

    As :func:`with_second_order`, but row by row and under the loads there: what is
    declared is then exact, and effects are to first order beside it.

    Args:
        here: R situations of a robot, as declared.

    Returns:
        The same, ``second_order`` given, and no longer ``exact`` if they were.
    """
    return replace(here, exact=False, second_order=_finite_part(here))


def _finite_part(here: Conditions, one_by_one: int | None = None) -> NDArray:
    """(R, 6) exact minus linear platform screws; none where one has no answer."""
    exact, linear = (
        _platform_screws(replace(here, exact=finite), one_by_one)[0]
        for finite in (True, False)
    )
    return np.nan_to_num(exact - linear)


def settle(here: Conditions) -> Conditions:
    """Conditions that say where play rests, found once by the least energy.

    Effects may then be tried on them at the cost of a robot without play, true to first
    order as long as joints keep touching where they touch.

    Args:
        here: R situations of a robot.

    Returns:
        The same, ``rest`` given; rows without an answer have it in the middle.
    """
    rest = np.zeros_like(here.errors)
    for row in range(len(here)):
        try:
            answer, _ = _settled(here, row)
        except (CannotAssemble, FreeMotion, SolverFailed):
            continue
        rest[row] = fractions(here.robot, answer.clearance_screws)
    return replace(here, rest=rest)


def read(here: Conditions, screws: NDArray) -> NDArray:
    """What the device makes of platform screws.

    Args:
        here: R situations.
        screws: (R, 6) [rad, m] rotation vector of R R_nominal^T and shift of the
            platform's origin, base axes.

    Returns:
        (R, 6) [rad, m] the deviation read at the reference point.
    """
    platform = here.postures.platform
    R, p = platform[:, :3, :3], platform[:, :3, 3]
    turn = rotation_matrix(screws[:, :3])
    arm = R @ here.point
    swung = np.einsum("rij,rj->ri", turn - np.eye(3), R @ (here.point + here.tool))
    shift = screws[:, 3:] + swung + R @ here.tool
    base = rotation_matrix(here.base[:3])
    # the device's turn acts on the place itself; without one nothing is rounded off
    where = (p + arm) @ (base - np.eye(3)).T + shift @ base.T + here.base[3:]
    turned = rotation_vector(base @ turn) if here.base[:3].any() else screws[:, :3]
    return np.concatenate([turned, where], axis=1) + here.reading


def assemble_row(here: Conditions, row: int) -> Assembly | ExactAssembly:
    """One situation in full: every screw and wrench of the robot.

    Args:
        here: situations.
        row: which.

    Returns:
        The linear or the exact assembly, as the conditions ask.

    Raises:
        CannotAssemble: a closure is open that nothing can close.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the solver gave up.
    """
    posture = here.posture(row)
    load = here.load_at_origin()[row]
    gravity = here.gravity[row] if here.gravity[row].any() else None
    give = np.zeros(len(here.laws))
    if here.exact and here.laws:  # the linear model settles them almost, and at once
        linear = assemble_row(replace(here, exact=False), row)
        give = _secants(linear, here.laws)
    answer: Assembly | ExactAssembly
    for _ in range(_STEPS):
        there = _softened(posture, here.laws, give)
        if here.exact:
            answer = solve_exact(
                there, here.load[row], gravity=gravity, point=here.point
            )
        else:
            answer = solve_assembly(there, load, gravity=gravity)
        before, give = give, _secants(answer, here.laws)
        near = _SETTLED_FINITE if here.exact else _SETTLED
        if np.all(np.abs(give - before) <= near * give):
            return answer
    raise SolverFailed("contact", f"deflections that do not settle in {_STEPS} steps")


def _softened(posture: Posture, laws: tuple[ContactLaw, ...], give: NDArray) -> Posture:
    """The posture with linear springs of the laws' secant compliance in series."""
    if not give.any():
        return posture
    frames = list(posture.robot.frames)
    for law, compliance in zip(laws, give, strict=True):
        i = posture.robot.index(law.frame)
        f = frames[i]
        K = in_series(f.joint_stiffness, f.own_axis, float(compliance))
        frames[i] = replace(f, joint_stiffness=K)
    return replace(posture, robot=replace(posture.robot, frames=tuple(frames)))


def _secants(answer: Assembly | ExactAssembly, laws: tuple[ContactLaw, ...]) -> NDArray:
    """[rad/(N m), m/N] deflection over load of every law at the load it carries."""
    robot = answer.posture.robot
    through = answer.joint_wrenches if isinstance(answer, Assembly) else answer.wrenches
    give = []
    for law in laws:
        i = robot.index(law.frame)
        load = abs(through[i] @ own_screw(robot.frames[i]))
        give.append(_deflection(law, load) / load if load > 1e-300 else 0.0)
    return np.array(give)


def _deflection(law: ContactLaw, load: float) -> float:
    """[rad or m] under a load >= 0."""
    return float((load / law.coefficient) ** (1 / law.exponent))


def _without_play(here: Conditions) -> tuple[NDArray, NDArray]:
    """(R, 6) platform screws of a robot without play, (R,) where they are solved."""
    distinct, which = in_groups(here.postures)
    flexible = flexibility(distinct)
    forces = row_forces(here.postures, here.load_at_origin(), here.gravity)
    errors = here.errors.reshape(len(here), -1)
    answer = flexible.solve(which, errors, forces)
    screws, solved = answer.platform_screw, answer.solved
    give = np.zeros((len(here), 0))
    if here.laws:
        columns = _law_columns(here)
        w = answer.joint_wrenches @ columns
        A = flexible.self_stress(columns)[which]
        give, settled = _deflections(here.laws, w, A)
        reach = flexible.platform_of(columns)[which]
        screws = screws + np.einsum("rij,rj->ri", reach, give)
        solved = solved & settled
    if here.exact:
        screws, found = solve_rows(here, give)
        solved = solved & found
    return screws, solved


def _law_columns(here: Conditions) -> NDArray:
    """(6n, s) unit screws of the joints with a contact law."""
    columns = np.zeros((6 * len(here.robot.frames), len(here.laws)))
    for k, law in enumerate(here.laws):
        i = here.robot.index(law.frame)
        columns[6 * i : 6 * i + 6, k] = own_screw(here.robot.frames[i])
    return columns


def _deflections(
    laws: tuple[ContactLaw, ...], w: NDArray, A: NDArray
) -> tuple[NDArray, NDArray]:
    """Deflections d of contacts, c |d|^n sign(d) = w + A d.

    Least of a strictly convex function (A is negative semidefinite): Newton's method,
    each step halved until the gradient shrinks.

    Returns:
        (R, s) deflections, and (R,) whether they were found.
    """
    c = np.array([law.coefficient for law in laws])
    n = np.array([law.exponent for law in laws])
    scale = np.abs(w).max(axis=1, keepdims=True) + 1e-300

    def gradient(d: NDArray) -> NDArray:
        own = c * np.abs(d) ** n * np.sign(d)
        return (own - w - np.einsum("rij,rj->ri", A, d)) / scale

    d = np.sign(w) * (np.abs(w) / c) ** (1 / n)
    left = gradient(d)
    tiny = 1e-9 * np.abs(A).max(initial=0.0) + 1e-300
    for _ in range(_STEPS):
        norm = np.linalg.norm(left, axis=1)
        if np.all(norm <= _SETTLED):
            break
        slope = c * n * np.abs(d) ** (n - 1) + tiny
        H = np.einsum("ri,ij->rij", slope, np.eye(len(c))) - A
        step = -np.linalg.solve(H, (left * scale)[..., None])[..., 0]
        length = np.where(norm <= _SETTLED, 0.0, 1.0)
        for _ in range(30):
            there = gradient(d + length[:, None] * step)
            worse = (np.linalg.norm(there, axis=1) > norm) & (length > 0)
            if not worse.any():
                break
            length = np.where(worse, length / 2, length)
        d, left = d + length[:, None] * step, there
    return d, np.linalg.norm(left, axis=1) <= 1e-8
