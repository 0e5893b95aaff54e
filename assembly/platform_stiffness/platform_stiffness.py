"""Stiffness matrix K_C of the platform in different states of the robot."""

from collections.abc import Sequence
from typing import Literal, cast, get_args, overload

from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import Posture, together
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.given_load import Load, one_load
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import (
    Side,
    in_contact,
    without_clearance,
)
from forcefit.assembly.platform_stiffness.many_stiffnesses import (
    Stiffnesses,
    many_of_each,
    many_without_clearance,
)
from forcefit.assembly.platform_stiffness.matrices import PlatformStiffness, numbers_of
from forcefit.assembly.solvers.method import Method, check_method
from forcefit.inputs.renamed import current_value

State = Literal["nominal", "contact", "exact"]
_OLD_SIDES = {"holding": "loading", "letting go": "unloading"}
_OLD_STATES = {"without clearance": "nominal", "in contact": "contact"}


@overload
def platform_stiffness(
    posture: Posture, state: State = "nominal",
    load: Load | None = None, gravity: ArrayLike | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0), side: Side = "loading",
    method: Method = "compiled",
) -> PlatformStiffness: ...  # fmt: skip


@overload
def platform_stiffness(
    posture: Sequence[Posture], state: State = "nominal",
    load: Load | None = None, gravity: ArrayLike | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0), side: Side = "loading",
    method: Method = "compiled",
) -> Stiffnesses: ...  # fmt: skip


def platform_stiffness(
    posture: Posture | Sequence[Posture],
    state: State = "nominal",
    load: Load | None = None,
    gravity: ArrayLike | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0),
    side: Side = "loading",
    method: Method = "compiled",
) -> PlatformStiffness | Stiffnesses:
    """Compute the tangent stiffness of the platform.

    The stiffness relates a small additional wrench to the resulting small motion.

    Args:
        posture: configuration of a robot, or many configurations of one robot.
        state: ``"nominal"`` for the classical virtual-joint model of the nominal robot,
            with clearances fixed at zero.  ``"contact"`` for problem (22), with errors,
            clearances and loads.  ``"exact"`` for finite motions, with the geometric
            stiffness due to internal forces and loads.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes; or a
            mapping of components such as ``{"fz": -50}``.  The classical model ignores
            loads.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        at: (3,) [m] reference point of screws and wrenches, in platform axes.
        side: ``"loading"`` if contacts without a force remain closed, ``"unloading"``
            if they open.
        method: ``"compiled"`` or ``"reference"``.  The reference method uses only numpy
            and Clarabel.  The classical model of one posture always uses the reference
            method.

    Returns:
        Stiffness, compliance, free motions and shares at the reference point, base
        axes.  For many postures, the result is a
        :class:`~forcefit.assembly.platform_stiffness.many_stiffnesses.Stiffnesses`.

    Raises:
        CannotAssemble: the loops cannot be closed with these errors.
        FreeMotion: a load acts on a motion without stiffness.
        SolverFailed: no equilibrium was found.
        BadInput: a point or a load does not consist of numbers.
        ValueError: ``state``, ``side`` or ``method`` is unknown.
    """
    check_method(method)
    offset = numbers_of("at", at, 3, "m")
    if load is not None:
        load = one_load(load)
    side = cast(Side, current_value("side", side, _OLD_SIDES))
    if side not in get_args(Side):
        raise ValueError(
            f"platform_stiffness: found side {side!r}, expected 'loading' or "
            "'unloading'"
        )
    state = cast(State, current_value("state", state, _OLD_STATES))
    if state not in get_args(State):
        raise ValueError(
            f"platform_stiffness: found state {state!r}, expected 'nominal', "
            "'contact' or 'exact'"
        )
    if not isinstance(posture, Posture):
        posture = together(posture)
    if posture.transforms.ndim == 3:
        return _of_one(posture, state, load, gravity, offset, side, method)
    if state == "nominal":
        many = many_without_clearance(posture, method)
        turned = posture.platform[:, :3, :3] @ offset
        return many.at(many.point + turned) if offset.any() else many
    return many_of_each(posture, [
        _of_one(posture[i], state, load, gravity, offset, side, method)
        for i in range(len(posture.transforms))
    ])  # fmt: skip


def _of_one(
    posture: Posture, state: State, load: ArrayLike | None, gravity: ArrayLike | None,
    offset: NDArray, side: Side, method: Method,
) -> PlatformStiffness:  # fmt: skip
    """Return the platform stiffness at one posture."""
    platform = posture.platform
    if state == "nominal":
        tangent = without_clearance(posture)
    elif state == "contact":
        linear = solve_assembly(posture, load, gravity=gravity, method=method)
        tangent = in_contact(linear, side)
    else:
        exact = solve_exact(posture, load, gravity=gravity, method=method)
        tangent, platform = exact_tangent(exact, side), exact.placement.platform
    return tangent.at(platform[:3, 3] + platform[:3, :3] @ offset)
