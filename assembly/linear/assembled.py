"""A manipulator forced together: screws, wrenches, energy, and the certificate.

======  ====================  ========  ==============================================
symbol  code                  shape     meaning
======  ====================  ========  ==============================================
dx_p    ``platform_screw``    (6,)      platform error at its origin, base axes
dc      ``clearance_screws``  (n, 6)    clearances, and small motions of passive joints
de, db  ``link_screws`` ..    (n, 6)    deformations of links and joints
w       ``wrenches``          (n, 6)    of each link's spring, at the frame in its axes
--      ``tip_wrenches``      (n, 6)    through the section at each link's tip
E       ``energy``            J         of all springs
======  ====================  ========  ==============================================

Wrenches come from the multipliers of the closures, not from eqs (23)-(26): springs in
series carry the same wrench, which (23) adds to itself, and the paths to the platform
alone, (24)-(26), sum to zero on an unloaded platform.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.closure_rates import closure_signs
from assembly.kinematics.posture import Posture
from assembly.linear.closure import Linearisation, VirtualJoints
from assembly.linear.load import (
    FrameLoads,
    loads_on_frames,
    weights,
    with_distributed,
    wrenches_at_starts,
)
from assembly.linear.reduction import reduce_problem
from assembly.linear.rounding import ROUNDING, closure_rounding, differs_from_zero
from assembly.model.clearance import Compliant, clearance_bounds, clearance_excess
from assembly.solvers.cones import cone_sizes
from assembly.solvers.method import Method
from forcefit.inputs.display import (
    Figures,
    html_table,
    largest_row,
    numbers,
    screw_text,
    short_repr,
)

if TYPE_CHECKING:
    import pandas
    import xarray

_ROUNDED = 1e-9  # of the largest wrench
_NOTHING = 1e-12  # [N m, N]


@dataclass(frozen=True, eq=False)
class Assembly:
    """A manipulator forced together at least energy; it exists only if solved.

    Attributes:
        linearisation: the assembly constraints it satisfies; where it stands.
        joints: what was allowed to move.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        frame_loads: all loads, this one among them, on every small screw.
        elastic: (ny,) [sqrt(2 J)] scaled deformation of the springs.
        clearances: (nu,) clearances in units of their cones.
        motions: (nq,) [rad, m] free motions.
        multipliers: (6 closures,) of the scaled closure rows.
        energy_without_clearance: [J] least energy with all clearances at zero.
        method: which gave it: ``"compiled"``, or ``"reference"``, numpy and Clarabel.
    """

    linearisation: Linearisation
    joints: VirtualJoints
    load: NDArray
    frame_loads: FrameLoads
    elastic: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray
    energy_without_clearance: float
    method: Method

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """What ``forcefit assembly solve`` prints of it."""
        forces = np.linalg.norm(without_rounding(self.tip_wrenches)[:, 3:], axis=1)
        most = largest_row(forces)  # bodies in a row carry the same force
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
    def ranks(self) -> dict[str, int]:
        """Numbers of rows of the closures: free, elastic, rigid, redundant."""
        return reduce_problem(self.linearisation, self.joints, self.frame_loads).ranks

    @property
    def posture(self) -> Posture:
        """Where the robot stands nominally."""
        return self.linearisation.posture

    @cached_property
    def energy(self) -> float:
        """[J] elastic energy stored; 0 where the certificate cannot tell it from 0."""
        nonzero = differs_from_zero(
            self.stored, self.duality_gap(), self.multipliers,
            self.closure_residual() + self.rounding,
        )  # fmt: skip
        return self.stored if nonzero else 0.0

    @property
    def stored(self) -> float:
        """[J] in the springs of the numerical solution."""
        return float(self.elastic @ self.elastic) / 2

    @property
    def potential(self) -> float:
        """[J] energy minus the work of the loads."""
        on_errors = self.frame_loads.body @ self.posture.robot.errors.ravel()
        return self.stored - self.work - float(on_errors)

    @property
    def work(self) -> float:
        """[J] of the loads on all small screws but the errors."""
        joints = self.clearance_screws + self.joint_screws
        on_bodies = self.frame_loads.body @ self.link_screws.ravel()
        return float(on_bodies + self.frame_loads.joint @ joints.ravel())

    @cached_property
    def clearance_screws(self) -> NDArray:
        """(n, 6) [rad, m] clearances, and small motions of passive joints."""
        screws = self.joints.cones @ self.clearances + self.joints.free @ self.motions
        return screws.reshape(-1, 6)

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
        """(n, 6) [rad, m] total screw at each frame, geometric error included."""
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
        """(n, 6) [N m, N] of each link's spring: K_E times the link's deformation.

        At the frame's origin, in its axes.  The link's own weight counts at its two
        ends here; :attr:`tip_wrenches` are what its section at the tip transmits.
        """
        return self._closing + self.frame_loads.body.reshape(-1, 6)

    @cached_property
    def tip_wrenches(self) -> NDArray:
        """(n, 6) [N m, N] what the outer part exerts on each body, at its tip.

        At the frame's origin, in its axes; the body's own weight acts along it.
        """
        return self.wrenches - self.frame_loads.at_tips

    @cached_property
    def start_wrenches(self) -> NDArray:
        """(n, 6) [N m, N] what links under their own weight transmit at their starts.

        At the link's start, in its frame's axes; NaN for bodies without such a weight.
        """
        at_tips = self.frame_loads.at_tips
        starts = wrenches_at_starts(self.posture.robot, self.tip_wrenches, at_tips)
        return starts if at_tips.any() else np.full_like(starts, np.nan)

    @cached_property
    def joint_wrenches(self) -> NDArray:
        """(n, 6) [N m, N] the same through each joint, equal to K_B times its screw.

        They differ from :attr:`tip_wrenches` by loads on the body at the frame.
        """
        return self._closing + self.frame_loads.joint.reshape(-1, 6)

    @cached_property
    def _closing(self) -> NDArray:
        """(n, 6) [N m, N] through each frame from the closures alone."""
        at_platform = closure_signs(self.posture.robot).T @ self.closure_wrenches
        return np.einsum("nji,nj->ni", self.posture.paths, at_platform)

    @cached_property
    def bound(self) -> float:
        """[J] certified lower bound of energy minus the load's work.

        The complementary energy of these wrenches, whatever they are: every assembly
        has at least -w.dl - w.C w/2 - (the most that clearances can gain).  How the
        problem was solved does not enter; free motions count as no larger than here.
        """
        body, joint = self.wrenches.ravel(), self.joint_wrenches.ravel()
        columns = self.joints
        springs = np.where(
            columns.links, columns.elastic.T @ body, columns.elastic.T @ joint
        )
        clearances = float(cone_sizes(columns.cones.T @ joint, columns.group).sum())
        slip = float(np.abs(columns.free.T @ joint) @ np.abs(self.motions))
        errors = float(body @ self.posture.robot.errors.ravel())
        return -errors - float(springs @ springs) / 2 - clearances - slip

    def has_loads(
        self,
        load: ArrayLike | None = None,
        bodies: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> bool:
        """Whether these, as of :func:`solve_assembly`, are its loads."""
        other = all_loads(self.posture, load, bodies, gravity)
        return np.array_equal(other.body, self.frame_loads.body) and np.array_equal(
            other.joint, self.frame_loads.joint
        )

    def closure_residual(self) -> float:
        """Largest of abs(rad) and abs(m) / reference length left open in a closure."""
        residual = self.linearisation.rows @ self.screws.ravel()
        return float(np.abs(residual).max(initial=0.0))

    def clearance_excess(self, compliant: Compliant = "elastic") -> float:
        """[-] by how much the worst clearance leaves its cone, relative to its size."""
        bounds = clearance_bounds(self.posture.robot, compliant)
        return clearance_excess(self.clearance_screws, bounds)

    @cached_property
    def rounding(self) -> float:
        """[rad, lengths] what rounding may leave open in a closure."""
        lin = self.linearisation
        return float(closure_rounding(self.posture.robot.errors, self.joints, lin.size))

    @cached_property
    def uncertainty(self) -> float:
        """[J] the duality gap without cancellation, and with rounding counted in.

        Energy minus its bound is |y - s|^2 / 2, with s the springs' deformations that
        balance the wrenches, plus for each cone what its wrench could still gain, plus
        the work of the multipliers on the closures' residual.
        """
        body, joint = self.wrenches.ravel(), self.joint_wrenches.ravel()
        columns = self.joints.elastic.T
        springs = self.elastic - np.where(
            self.joints.links, columns @ body, columns @ joint
        )
        on_cones = self.joints.cones.T @ joint
        sizes = cone_sizes(on_cones, self.joints.group)
        gains = sizes - np.bincount(
            self.joints.group, weights=on_cones * self.clearances, minlength=len(sizes)
        )
        slip = np.abs(self.joints.free.T @ joint) @ np.abs(self.motions)
        residual = np.abs(self.linearisation.rows @ self.screws.ravel()) + self.rounding
        work_on_residual = float(np.abs(self.multipliers) @ residual)
        return float(
            springs @ springs / 2 + np.maximum(gains, 0.0).sum() + 2 * slip
            + work_on_residual + ROUNDING * (sizes.sum() + abs(self.work))
        )  # fmt: skip

    def duality_gap(self) -> float:
        """[J] certified: the energy is at most this above the least possible."""
        # in this order NaN stays NaN
        return max(self.potential - self.bound, 0.0)

    def relative_gap(self) -> float:
        """[-] duality gap relative to energy, or to 1e-4 of that without clearance."""
        # inside an assembly zone the least energy is zero, and no gap relative to it
        scale = max(self.stored, 1e-4 * self.energy_without_clearance, 1e-300)
        return self.duality_gap() / scale


def without_rounding(wrenches: NDArray) -> NDArray:
    """Wrenches without components that are rounding of the others.

    Args:
        wrenches: (..., n, 6) [N m, N] of the n bodies of a robot.

    Returns:
        The same, 0 what is below 1e-9 of the largest of a robot, or below 1e-12.
    """
    sizes = np.abs(wrenches)
    largest = sizes.max(axis=(-2, -1), keepdims=True, initial=0.0)
    least = np.maximum(_ROUNDED * largest, _NOTHING)
    return np.where(sizes < least, 0.0, wrenches)


def all_loads(
    posture: Posture,
    load: ArrayLike | None,
    bodies: ArrayLike | None,
    gravity: ArrayLike | None,
) -> FrameLoads:
    """Loads on all small screws, from the arguments of ``solve_assembly``.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        bodies: (n, 6) [N m, N] wrenches on the bodies of all frames.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The loads.
    """
    carried = None
    if gravity is not None:
        body_weights, carried = weights(posture, gravity)
        bodies = body_weights if bodies is None else body_weights + np.asarray(bodies)
    loads = loads_on_frames(posture, load, bodies, carried)
    return loads if gravity is None else with_distributed(loads, posture, gravity)
