"""The least energy that closes a manipulator, problem (22), and what it costs inside.

======  ====================  ========  ==============================================
symbol  code                  shape     meaning
======  ====================  ========  ==============================================
dx_p    ``platform_screw``    (6,)      platform error at its origin, base axes
dc      ``clearance_screws``  (n, 6)    play, and the small motion of passive joints
de, db  ``link_screws`` ..    (n, 6)    deformations of links and joints
w       ``wrenches``          (n, 6)    through each frame, at it in its axes
E       ``energy``            J         of all springs
======  ====================  ========  ==============================================

Wrenches come from the multipliers of the closures, not from eqs (23)-(26): springs in
series carry the same wrench, which (23) adds to itself, and the paths to the platform
alone, (24)-(26), sum to zero on an unloaded platform.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    closure_signs,
    linearise,
    virtual_joints,
)
from assembly.linear.load import Forces, forces_on, weights
from assembly.linear.reduction import FreeMotion, Reduction, reduce_problem
from assembly.linear.rounding import (
    ROUNDING,
    closure_rounding,
    stiffness_spread,
    told_from_zero,
)
from assembly.model.clearance import (
    clearance_bounds,
    clearance_excess,
    has_bounded_motion,
)
from assembly.solvers.conic import (
    GAP,
    GAP_WITHOUT_PLAY,
    LeastEnergy,
    cone_sizes,
    minimise_energy,
)
from forcefit.inputs.display import Figures, html_table, numbers, screw_text, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray


if TYPE_CHECKING:
    from assembly.linear.screw_bound import ScrewBound

LEFT_OPEN, EXCESS = 1e-9, 1e-9  # accepted: [rad, lengths] of a closure, [-] of play
_RIGID_BESIDE = 1e19  # springs so much stiffer than the softest are taken for rigid


class CannotAssemble(Exception):
    """No play and no elasticity of the model lets the closures hold.

    A result, not a mistake of the caller: some closure is rigid all round.
    """


@dataclass(frozen=True, eq=False)
class Assembly:
    """A manipulator forced together at least energy; it exists only if solved.

    Attributes:
        linearisation: the assembly constraints it satisfies.
        joints: what was allowed to move.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        forces: of all loads, this one among them, on every small screw.
        elastic: (ny,) [sqrt(2 J)] scaled deformation of the springs.
        clearances: (nu,) clearances in units of their cones.
        motions: (nq,) [rad, m] free motions.
        multipliers: (6 closures,) of the scaled closure rows.
        energy_without_play: [J] what closing would cost with all clearances at zero.
        ranks: rows of the closures by what takes them up.
    """

    linearisation: Linearisation
    joints: VirtualJoints
    load: NDArray
    forces: Forces
    elastic: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray
    energy_without_play: float
    ranks: dict[str, int]

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """What ``forcefit assembly solve`` prints of it."""
        forces = np.linalg.norm(self.wrenches[:, 3:], axis=1)
        most = int(forces.argmax())
        return {
            "pose": f"{numbers(self.posture.pose().values())} m, rad",
            **({"load": f"{numbers(self.load)} N m, N"} if self.load.any() else {}),
            "energy": f"{self.energy:.6g} J",
            "platform error": screw_text(self.platform_screw),
            "largest force": f"{forces[most]:.4g} N, in "
            f"{self.posture.robot.frames[most].name}",
            "certificate": f"closure residual {self.closure_residual():.1e}, clearance "
            f"excess {self.clearance_excess():.1e}, gap {self.duality_gap():.1e} J",
        }

    def to_xarray(self) -> "xarray.Dataset":
        """Frames, closures and platform; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import assembly_dataset

        return assembly_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each frame, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "frame")

    @property
    def posture(self) -> Posture:
        """Where the robot stands nominally."""
        return self.linearisation.posture

    @cached_property
    def energy(self) -> float:
        """[J] elastic energy stored; 0 where the certificate cannot tell it from 0."""
        told = told_from_zero(
            self.stored, self.duality_gap(), self.multipliers,
            self.closure_residual() + self.rounding,
        )  # fmt: skip
        return self.stored if told else 0.0

    @property
    def stored(self) -> float:
        """[J] in the springs as they were found."""
        return float(self.elastic @ self.elastic) / 2

    @property
    def potential(self) -> float:
        """[J] energy minus the work of the loads."""
        on_errors = self.forces.body @ self.posture.robot.errors.ravel()
        return self.stored - self._work - float(on_errors)

    @property
    def _work(self) -> float:
        """[J] of the loads on all that is not given, the errors."""
        joints = self.clearance_screws + self.joint_screws
        on_bodies = self.forces.body @ self.link_screws.ravel()
        return float(on_bodies + self.forces.joint @ joints.ravel())

    @cached_property
    def clearance_screws(self) -> NDArray:
        """(n, 6) [rad, m] play, and small motions of passive joints."""
        play = self.joints.cones @ self.clearances + self.joints.free @ self.motions
        return play.reshape(-1, 6)

    @cached_property
    def link_screws(self) -> NDArray:
        """(n, 6) [rad, m] deformations of the bodies."""
        return (self.joints.elastic @ (self.elastic * self.joints.links)).reshape(-1, 6)

    @cached_property
    def joint_screws(self) -> NDArray:
        """(n, 6) [rad, m] deformations of the joints."""
        springs = self.elastic * ~self.joints.links
        return (self.joints.elastic @ springs).reshape(-1, 6)

    @cached_property
    def screws(self) -> NDArray:
        """(n, 6) [rad, m] all that happens at each frame, geometric error included."""
        moved = self.clearance_screws + self.link_screws + self.joint_screws
        return self.posture.robot.errors + moved

    @cached_property
    def platform_screw(self) -> NDArray:
        """(6,) [rad, m] platform's pose error at its origin, base axes, eq. (8)."""
        return self.linearisation.platform @ self.screws.ravel()

    @cached_property
    def closure_wrenches(self) -> NDArray:
        """(closures, 6) [N m, N] what each closure's second chain exerts on its first.

        At the platform's origin, base axes.  Where rigid parts are overconstrained
        they are not determined; these are then the smallest ones.
        """
        size = self.linearisation.size
        return self.multipliers.reshape(-1, 6) / np.array([1, 1, 1, size, size, size])

    @cached_property
    def wrenches(self) -> NDArray:
        """(n, 6) [N m, N] what the outer part exerts on the inner through each body.

        At the frame's origin, in its axes; equal to K_E times the link's deformation.
        """
        return self._closing + self.forces.body.reshape(-1, 6)

    @cached_property
    def joint_wrenches(self) -> NDArray:
        """(n, 6) [N m, N] the same through each joint, equal to K_B times its screw.

        They differ from :attr:`wrenches` by loads on the body, its weight for one.
        """
        return self._closing + self.forces.joint.reshape(-1, 6)

    @cached_property
    def _closing(self) -> NDArray:
        """(n, 6) [N m, N] through each frame from the closures alone."""
        at_platform = closure_signs(self.posture.robot).T @ self.closure_wrenches
        return np.einsum("nji,nj->ni", self.posture.paths, at_platform)

    @cached_property
    def bound(self) -> float:
        """[J] certified lower bound of energy minus the load's work.

        The complementary energy of the wrenches found, whatever they are: against
        every assembly they do no less than -w.dl - w.C w/2 - (the most that play can
        gain).  Nothing of how the problem was solved enters; free motions count as
        no larger than the answer's.
        """
        body, joint = self.wrenches.ravel(), self.joint_wrenches.ravel()
        columns = self.joints
        springs = np.where(
            columns.links, columns.elastic.T @ body, columns.elastic.T @ joint
        )
        play = float(cone_sizes(columns.cones.T @ joint, columns.group).sum())
        slip = float(np.abs(columns.free.T @ joint) @ np.abs(self.motions))
        errors = float(body @ self.posture.robot.errors.ravel())
        return -errors - float(springs @ springs) / 2 - play - slip

    def has_loads(
        self,
        load: ArrayLike | None = None,
        bodies: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> bool:
        """Whether these, as of :func:`solve_assembly`, are its loads."""
        other = _all_forces(self.posture, load, bodies, gravity)
        return np.array_equal(other.body, self.forces.body) and np.array_equal(
            other.joint, self.forces.joint
        )

    def closure_residual(self) -> float:
        """Largest of abs(rad) and abs(m) / reference length left open in a closure."""
        left = self.linearisation.rows @ self.screws.ravel()
        return float(np.abs(left).max(initial=0.0))

    def clearance_excess(self, compliant: str = "elastic") -> float:
        """[-] by how much the worst clearance leaves its cone, relative to its size."""
        turns = compliant in {"free", "hinged"}
        bounds = clearance_bounds(self.posture.robot, "free" if turns else "elastic")
        return clearance_excess(self.clearance_screws, bounds)

    @cached_property
    def rounding(self) -> float:
        """[rad, lengths] what rounding may leave open in a closure."""
        lin = self.linearisation
        return float(closure_rounding(self.posture.robot.errors, self.joints, lin.size))

    @cached_property
    def uncertainty(self) -> float:
        """[J] the duality gap without cancellation, and with rounding counted in.

        Energy minus its bound is |y - s|^2 / 2, with s the springs as the wrenches
        would have them, plus for each cone what its wrench could still gain, plus the
        work of the multipliers on what the closures leave open.
        """
        body, joint = self.wrenches.ravel(), self.joint_wrenches.ravel()
        pull = self.joints.elastic.T
        springs = self.elastic - np.where(self.joints.links, pull @ body, pull @ joint)
        pulls = self.joints.cones.T @ joint
        sizes = cone_sizes(pulls, self.joints.group)
        gains = sizes - np.bincount(
            self.joints.group, weights=pulls * self.clearances, minlength=len(sizes)
        )
        slip = np.abs(self.joints.free.T @ joint) @ np.abs(self.motions)
        left = np.abs(self.linearisation.rows @ self.screws.ravel()) + self.rounding
        still_open = float(np.abs(self.multipliers) @ left)
        return float(
            springs @ springs / 2 + np.maximum(gains, 0.0).sum() + 2 * slip
            + still_open + ROUNDING * (sizes.sum() + abs(self._work))
        )  # fmt: skip

    @cached_property
    def screw_bound(self) -> "ScrewBound":
        """How far any platform screw of least energy may be from this one's."""
        from assembly.linear.screw_bound import bound_screw

        return bound_screw(self)

    def duality_gap(self) -> float:
        """[J] certified: the energy is at most this above the least possible."""
        # in this order a gap that is not a number stays one
        return max(self.potential - self.bound, 0.0)

    @cached_property
    def unproved(self) -> str:
        """What the certificate leaves unproved, empty if nothing.

        Proved is an answer that closes to 1e-9 (rad, or m per reference length), with
        play within 1e-9 of its bounds, whose energy is at most 1e-8 of it, and of the
        loads' work, plus 1e-12 of that without play above the least possible.
        """
        from assembly.linear.screw_bound import springs_settled, unproved_screw

        left, excess, gap = (
            self.closure_residual(), self.clearance_excess(), self.duality_gap()
        )  # fmt: skip
        allowed = GAP * (self.stored + abs(self._work))
        allowed += GAP_WITHOUT_PLAY * self.energy_without_play
        said = []
        # written so that a value that is not a number is not proved
        if not gap <= allowed:
            said.append(
                f"the energy is proved least to {gap:.1e} J only, "
                f"expected {allowed:.1e} J"
            )
        if not left <= LEFT_OPEN:
            said.append(f"a closure stays open by {left:.1e} (rad, or m per length)")
        if not excess <= EXCESS:
            said.append(f"a clearance is exceeded by {excess:.1e} of its size")
        if not said and not springs_settled(self):
            said += unproved_screw(self)
        return "; ".join(said)

    def relative_gap(self) -> float:
        """[-] duality gap relative to energy, or to 1e-4 of that without play."""
        # inside an assembly zone the least energy is zero, and no gap relative to it
        scale = max(self.stored, 1e-4 * self.energy_without_play, 1e-300)
        return self.duality_gap() / scale


def solve_assembly(
    posture: Posture,
    load: ArrayLike | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> Assembly:
    """Close a manipulator at least energy, problem (22), under optional loads.

    Args:
        posture: where the robot stands; its errors, clearances, links and joint
            springs are the robot's.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes; energy
            minus its work is then what is minimised.
        bodies: (n, 6) [N m, N] wrenches on the bodies of all frames, each at its
            frame's origin, base axes.
        gravity: (3,) [m/s^2] base axes; links with a density and bodies with a mass
            then have weight.

    Returns:
        The assembled manipulator with its certificate; ``unproved`` says where that
        falls short after all roads.

    Raises:
        CannotAssemble: a closure is open that no play and no spring can close.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver gave up.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    forces = _all_forces(posture, wrench, bodies, gravity)
    return _solve_within(linearise(posture), "elastic", wrench, forces)


def _solve_within(
    lin: Linearisation, compliant: str, load: NDArray, forces: Forces
) -> Assembly:
    """Close a manipulator; bounds of passive joints' motion count where they matter."""
    robot = lin.posture.robot
    try:
        answer = solve_with(lin, virtual_joints(robot, compliant), load, forces)
    except FreeMotion:
        if not has_bounded_motion(robot):
            raise
    else:
        if answer.clearance_excess(compliant) <= 1e-9:
            return answer
    # the bound of a passive joint's own motion was left out, but it matters
    joints = virtual_joints(robot, compliant, bounded_motion=True)
    return solve_with(lin, joints, load, forces)


def _all_forces(
    posture: Posture,
    load: ArrayLike | None,
    bodies: ArrayLike | None,
    gravity: ArrayLike | None,
) -> Forces:
    """Forces of everything that :func:`solve_assembly` takes."""
    carried = None
    if gravity is not None:
        own, carried = weights(posture, gravity)
        bodies = own if bodies is None else own + np.asarray(bodies)
    return forces_on(posture, load, bodies, carried)


def solve_with(
    lin: Linearisation, joints: VirtualJoints, load: NDArray, forces: Forces
) -> Assembly:
    """Close a manipulator at least energy with a given choice of what may move.

    Args:
        lin: the assembly constraints.
        joints: what may move.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        forces: of all loads, this one among them.

    Returns:
        The assembled manipulator.

    Raises:
        CannotAssemble: a closure is open that nothing can close.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver gave up.
    """
    small = reduce_problem(lin, joints, forces)
    least = _minimise(small)
    u = least.clearances
    y = small.springs(u)
    q = small.motions(u, y)
    multipliers = small.multipliers(least.springs, least.rigid_multipliers)
    answer = Assembly(
        lin, joints, load, forces, y, u, q, multipliers, small.energy_without_play,
        small.ranks,
    )  # fmt: skip
    left = answer.closure_residual() + answer.rounding
    if forces or told_from_zero(answer.stored, 0.0, multipliers, left):
        return answer
    # nothing is forced: springs and wrenches are rounding of zero
    nothing = np.zeros_like(y), np.zeros_like(multipliers)
    return replace(answer, elastic=nothing[0], multipliers=nothing[1])


def without_own_springs(answer: Assembly) -> Assembly:
    """The least energy when compliant joints turn freely about their own axis."""
    return _solve_within(answer.linearisation, "hinged", answer.load, answer.forces)


def _minimise(small: Reduction) -> LeastEnergy:
    """Least energy of a reduced problem; infeasible ones are named."""
    joints = small.joints
    spread = stiffness_spread(joints, small.linearisation.size)
    beyond = ""
    if spread > _RIGID_BESIDE:
        beyond = (
            f"; stiffnesses differ {spread:.0e} times, more than a double carries: the "
            "stiffest count as rigid"
        )
    if small.inconsistent:
        raise CannotAssemble(
            f"a rigid part stays open by {small.inconsistent:.3g} (rad, or m per "
            f"reference length): no play or spring acts there{beyond}"
        )
    least = minimise_energy(small.G, small.h, small.d, small.H, small.k, joints.group)
    if not least.feasible:
        raise CannotAssemble(
            f"no play within its bounds closes what no spring can{beyond}"
        )
    return least
