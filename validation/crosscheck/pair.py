"""Define the pair of solutions of two models at one scale of the imperfections."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.validation.multibody.exudyn_model import HOLDING_STIFFNESS, IDLE_STIFFNESS
from forcefit.validation.multibody.simulation import MultibodyAssembly


@dataclass(frozen=True, eq=False)
class Pair:
    """Solutions of two models at one scale.

    Attributes:
        scale: factor on errors, clearances and load.
        linear: result of the virtual-joint model.
        simulated: result of the simulation.
        exact: result of the virtual-joint model with finite rotations; None if no
            solution was found.
        between: [J] energy of distributed weights in the beams of the simulation. The
            linear model does not include this energy.
        holding: solution of the linear model with the springs of
            :func:`hold_free_motions`, used to estimate the effect of weaker springs in
            the simulation.  None if the simulation contains no such springs.
    """

    scale: float
    linear: Assembly
    simulated: MultibodyAssembly
    exact: ExactAssembly | None
    between: float = 0.0
    holding: Assembly | None = None

    def noise_of(self, quantity: str) -> NDArray:
        """Return the effect of the weak springs on free motions at scale 1.

        The effect is proportional to the stiffness of these springs.

        Args:
            quantity: name of a screw or wrench of an ``Assembly`` that is proportional
                to the scale.

        Returns:
            Absolute changes of the quantity.  They are 0 if both models contain the
            same springs.
        """
        value = np.asarray(getattr(self.linear, quantity))
        if self.holding is None or self.simulated.held:
            return np.zeros_like(value)
        change = np.abs(np.asarray(getattr(self.holding, quantity)) - value)
        noise: NDArray = change * (IDLE_STIFFNESS / HOLDING_STIFFNESS / self.scale)
        return noise

    @property
    def linear_energy(self) -> float:
        """Energy [J] of the linear model, plus the energy of distributed weights.

        The energy of weak springs on free motions is not included.
        """
        robot = self.linear.posture.robot
        held = holding_energy(robot, self.linear.joint_screws)
        return self.linear.energy - held + self.between

    @property
    def screw_difference(self) -> NDArray:
        """Simulated minus linear platform screw, (6,) [rad, m]."""
        return self.simulated.platform_screw - self.linear.platform_screw

    def table(self, robot: Robot) -> dict[str, Any]:
        """Return both solutions and their differences as plain values."""
        linear, simulated = self.linear, self.simulated
        vjm = {
            "platform_screw": linear.platform_screw,
            "energy": linear.energy,
            "energy_between_ends": self.between,
            "links": _named(robot, "link", linear.wrenches),
            "joints": _named(robot, "joint_stiffness", linear.joint_wrenches),
        }
        multibody = {
            "platform_screw": simulated.platform_screw,
            "energy": simulated.energy,
            "links": _named(robot, "link", simulated.link_wrenches),
            "joints": _named(robot, "joint_stiffness", simulated.joint_wrenches),
        }
        joints = simulated.joint_wrenches - linear.joint_wrenches
        difference = {
            "platform_screw": self.screw_difference,
            "energy": simulated.energy - linear.energy,
            "links": _named(robot, "link", simulated.link_wrenches - linear.wrenches),
            "joints": _named(robot, "joint_stiffness", joints * sprung(robot)),
        }
        check = {
            "closure_gap": simulated.gap,
            "free_motions_held": simulated.held,
            "seconds": simulated.seconds,
        }
        exact = self.exact and {
            "platform_screw": self.exact.platform_screw,
            "energy": self.exact.energy,
            "links": _named(robot, "link", self.exact.wrenches),
            "joints": _named(robot, "joint_stiffness", self.exact.wrenches),
        }
        return {
            "scale": self.scale,
            "vjm": vjm,
            "exact_vjm": exact,
            "multibody": multibody | check,
            "difference": difference,
        }


def sprung(robot: Robot) -> NDArray:
    """Return which components of joints have springs.

    Args:
        robot: robot of n frames.

    Returns:
        Array with 1 where K_B is finite and 0 elsewhere, (n, 6).
    """
    rows = np.zeros((len(robot.frames), 6))
    for row, frame in zip(rows, robot.frames, strict=True):
        if frame.springs is not None:
            row[:] = np.isfinite(np.diag(frame.springs))
    return rows


def _named(robot: Robot, part: str, rows: NDArray) -> dict[str, NDArray]:
    """Return the values of an array for each frame with a link or joint."""
    return {
        frame.name: row
        for frame, row in zip(robot.frames, rows, strict=True)
        if getattr(frame, part) is not None
    }


def hold_free_motions(posture: Posture) -> Posture:
    """Return the posture of a robot with weak springs on free motions.

    Args:
        posture: posture of a robot without clearances.

    Returns:
        The posture with a spring of stiffness
        :data:`~forcefit.validation.multibody.exudyn_model.HOLDING_STIFFNESS` at each
        passive joint without a spring.
    """

    def hold(frame: Frame) -> Frame:
        if not frame.passive or frame.compliant:
            return frame
        rigid = np.diag(np.full(6, np.inf))
        K = np.array(rigid if frame.springs is None else frame.springs)
        K[frame.own_axis, frame.own_axis] = HOLDING_STIFFNESS
        return replace(frame, joint_stiffness=K)

    frames = tuple(hold(frame) for frame in posture.robot.frames)
    return replace(posture, robot=replace(posture.robot, frames=frames))


def holding_energy(robot: Robot, joint_screws: NDArray) -> float:
    """Return the energy of the weak springs on free motions.

    Args:
        robot: robot of the virtual-joint model.
        joint_screws: (n, 6) [rad, m] deformations of its joints.

    Returns:
        The energy [J].
    """
    stored = 0.0
    for frame, screw in zip(robot.frames, joint_screws, strict=True):
        if frame.compliant and frame.own_stiffness == HOLDING_STIFFNESS:
            stored += HOLDING_STIFFNESS * screw[frame.own_axis] ** 2 / 2
    return stored


def exact_solution(
    linear: Assembly, gravity: ArrayLike | None = None
) -> ExactAssembly | None:
    """Return the solution with finite rotations near a linear solution.

    The moment of the load is a couple of forces of constant direction, as in the
    simulation.

    Args:
        linear: linear solution from which the iteration starts.
        gravity: (3,) [m/s^2] gravity in base axes, as in the linear solution.

    Returns:
        The solution, or None if the iteration does not converge.
    """
    joints, robot = linear.joints, linear.posture.robot
    if not any(A.shape[1] for A in (joints.elastic, joints.cones, joints.free)):
        return None  # no joint or link can deform
    couple = np.zeros((len(robot.frames), 6))
    couple[robot.index(robot.platform), :3] = linear.load[:3]
    force = np.concatenate([np.zeros(3), linear.load[3:]])
    try:
        return solve_exact(linear.posture, force, linear, couple, gravity)
    except (SolverFailed, FreeMotion):
        return None


def scaled(posture: Posture, scale: float) -> Posture:
    """Return a posture with all imperfections multiplied by a factor.

    Args:
        posture: the posture at scale 1.
        scale: factor by which geometric errors, clearances and drive forces are
            multiplied.

    Returns:
        The posture of the scaled robot.
    """

    def smaller(frame: Frame) -> Frame:
        given = frame.clearance
        if given is not None:
            bounds = {k: v if v is None else scale * v for k, v in vars(given).items()}
            given = Clearance(**bounds)
        error = scale * frame.geometric_error
        force = scale * frame.drive_force
        return replace(frame, geometric_error=error, clearance=given, drive_force=force)

    frames = tuple(smaller(frame) for frame in posture.robot.frames)
    return replace(posture, robot=replace(posture.robot, frames=frames))
