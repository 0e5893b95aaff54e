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
from assembly.linear.closure import virtual_joints
from assembly.linear.energy import Assembly, CannotAssemble, solve_assembly
from assembly.linear.load import row_forces
from assembly.linear.nearest_pose import nearest_pose
from assembly.linear.reduction import FreeMotion
from assembly.linear.without_clearance import flexibility, in_groups
from assembly.measurement.conditions import Conditions
from assembly.measurement.contacts import (
    contact_columns,
    contact_deflections,
    secants,
    softened,
    wrenches_through,
)
from assembly.measurement.exact_rows import solve_rows
from assembly.measurement.settled_clearance import (
    at_rest,
    fractions,
    taken_up,
    without_play,
)
from assembly.measurement.yields import Yields, settle_yields, with_springs
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
    """(R, 6) exact minus linear platform screws; none where one has no answer.

    Places that give by laws of their own are left to the linear model.

    Returns:
        What finite motions add.
    """
    here = replace(here, yields=())
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
        (R, 6) [rad, m] the deviation read at the points measured.
    """
    platform = here.postures.platform
    R, p = platform[:, :3, :3], platform[:, :3, 3]
    turn = rotation_matrix(screws[:, :3])
    arm = here.measured_arms
    tool = _turned(R, here.tool)
    swung = np.einsum("rij,rj->ri", turn - np.eye(3), arm + tool)
    shift = screws[:, 3:] + swung + tool
    base = rotation_matrix(here.base[..., :3])
    # the device's turn acts on the place itself; without one nothing is rounded off
    where = _turned(base - np.eye(3), p + arm) + _turned(base, shift)
    where += here.base[..., 3:]
    turns = here.base[..., :3].any()
    turned = rotation_vector(base @ turn) if turns else screws[:, :3]
    return np.concatenate([turned, where], axis=1) + here.reading


def _turned(R: NDArray, vectors: NDArray) -> NDArray:
    """(R, 3) vectors turned by one matrix, or each by its own."""
    return (R @ vectors[..., None])[..., 0]


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
    if here.yields:
        return _assemble_yielding(with_springs(here, row))
    posture = here.posture(row)
    load = here.load_at_origin()[row]
    gravity = here.gravity[row] if here.gravity[row].any() else None
    give = np.zeros(len(here.laws))
    if here.exact and here.laws:  # the linear model settles them almost, and at once
        linear = assemble_row(replace(here, exact=False), row)
        give = secants(linear, here.laws)
    answer: Assembly | ExactAssembly
    for _ in range(_STEPS):
        there = softened(posture, here.laws, give)
        if here.exact:
            answer = solve_exact(
                there, here.load[row], gravity=gravity, point=here.point
            )
        else:
            answer = solve_assembly(there, load, gravity=gravity)
        before, give = give, secants(answer, here.laws)
        near = _SETTLED_FINITE if here.exact else _SETTLED
        if np.all(np.abs(give - before) <= near * give):
            return answer
    raise SolverFailed("contact", f"deflections that do not settle in {_STEPS} steps")


def _assemble_yielding(one: Conditions) -> Assembly | ExactAssembly:
    """One situation whose places give by laws of their own."""

    def solve(there: Conditions) -> tuple[Assembly | ExactAssembly, NDArray]:
        answer = assemble_row(there, 0)
        return answer, wrenches_through(answer).reshape(1, -1)

    def stress(yields: Yields) -> NDArray:
        tight = replace(one.postures, robot=without_play(one.robot))
        return flexibility(tight).self_stress(yields.places, yields.read)

    return settle_yields(one, solve, stress) if one.yields else assemble_row(one, 0)


def _without_play(here: Conditions) -> tuple[NDArray, NDArray]:
    """(R, 6) platform screws of a robot without play, (R,) where they are solved."""
    if not here.yields:
        screws, _, solved = _linear(here)
        return screws, solved
    unsolved = np.full((len(here), 6), np.nan), np.zeros(len(here), dtype=bool)
    if here.exact:
        return unsolved  # row by row, under the wrenches of finite motions
    distinct, which = in_groups(here.postures)

    def solve(there: Conditions) -> tuple[tuple[NDArray, NDArray], NDArray]:
        screws, wrenches, solved = _linear(there)
        return (screws, solved), wrenches

    def stress(yields: Yields) -> NDArray:
        A = flexibility(distinct).self_stress(yields.places, yields.read)
        return A[which]

    try:
        return settle_yields(here, solve, stress)
    except SolverFailed:
        return unsolved


def _linear(here: Conditions) -> tuple[NDArray, NDArray, NDArray]:
    """Robots without play and yields.

    Returns:
        (R, 6) platform screws, (R, 6n) joint wrenches of the linear model, and (R,)
        where they are solved.
    """
    distinct, which = in_groups(here.postures)
    flexible = flexibility(distinct)
    forces = row_forces(here.postures, here.load_at_origin(), here.gravity)
    errors = here.errors.reshape(len(here), -1)
    answer = flexible.solve(which, errors, forces)
    screws, solved = answer.platform_screw, answer.solved
    wrenches = answer.joint_wrenches
    give = np.zeros((len(here), 0))
    if here.laws:
        columns = contact_columns(here)
        w = wrenches @ columns
        A = flexible.self_stress(columns)[which]
        give, settled = contact_deflections(here.laws, w, A)
        reach = flexible.platform_of(columns)[which]
        screws = screws + np.einsum("rij,rj->ri", reach, give)
        everywhere = flexible.self_stress(columns, np.eye(len(columns)))[which]
        wrenches = wrenches + np.einsum("rij,rj->ri", everywhere, give)
        solved = solved & settled
    if here.exact:
        screws, found = solve_rows(here, give)
        solved = solved & found
    return screws, wrenches, solved
