"""Numerical solution of the minimum-energy problem, for one or many points.

:class:`forcefit.assembly.linear.assembled.Assembly` adds the derived quantities.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture, together
from forcefit.assembly.linear.closure import Linearisation, VirtualJoints
from forcefit.assembly.linear.load import FrameLoads
from forcefit.assembly.model.point_results import N, PointResults, plain
from forcefit.assembly.model.statuses import OK

_VECTORS = ("elastic", "clearances", "motions", "multipliers")
# names of derived values that can be stored
KNOWN = (
    "energy", "platform_screw", "work", "potential", "bound", "_gap", "_residual",
    "_excess",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Solution(PointResults, Generic[N]):
    """Numerical minimum-energy solution of a manipulator at one or many points.

    The arrays of many points begin with a point axis.

    Attributes:
        linearisation: the assembly constraints, with the posture.
        joints: the virtual joints that can move.
        load: (..., 6) [N m, N] wrench on the platform at its origin, base axes.
        frame_loads: all loads on every small screw, including ``load``.
        elastic: (..., ny) [sqrt(2 J)] scaled deformations of the springs.
        clearances: (..., nu) clearances in units of their cones.  If there are many
            points, NaN where the motion limit of a passive joint is active; ``[i]``
            returns the values at these points.
        motions: (..., nq) [rad, m] free motions; NaN at the same points.
        multipliers: (..., 6 closures) multipliers of the scaled closure rows.
        energy_without_clearance: (...) [J] minimum energy with all clearances zero.
        method: (...) method that solved the point: ``"compiled"``, or ``"reference"``
            for numpy and Clarabel.
        errors: (..., n, 6) [rad, m] geometric errors; None for those of the robot.
        status: (...) ``"ok"``; for many points also ``"cannot assemble"``,
            ``"no equilibrium"``, or ``"solver failed"``, which also denotes a
            certificate that is too weak.
        reason: (...) message if the status is not ok.
        apart: separately stored points by index: an assembly whose columns differ from
            ``joints``, or the exception raised if there is no solution.
        held: sorted indices of the points at which motion limits of passive joints are
            active, and the assembly of these points with all motion limits as cones.
    """

    linearisation: Linearisation
    joints: VirtualJoints
    load: NDArray
    frame_loads: FrameLoads
    elastic: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray
    energy_without_clearance: N
    method: Any
    errors: Any = None
    status: Any = OK
    reason: Any = ""
    apart: dict[int, Any] = field(default_factory=dict)
    held: Any = None

    AXES: ClassVar = {
        "energy_without_clearance": 0, "method": 0, "status": 0, "reason": 0, "load": 1,
        "elastic": 1, "clearances": 1, "motions": 1, "multipliers": 1, "errors": 2,
    }  # fmt: skip
    VARIABLES: ClassVar = {
        "energy": "energy",
        "duality_gap": "_gap",
        "energy_without_clearance": "energy_without_clearance",
        "platform_screw": "platform_screw",
        "closure_residual": "_residual",
        "clearance_excess": "_excess",
        "method": "method",
        "status": "status",
        "reason": "reason",
    }

    @property
    def posture(self) -> Posture:
        """Nominal configuration of the robot."""
        return self.linearisation.posture

    def __getitem__(self, rows: Any) -> Self:
        """Return the solution at one point or a selection of points."""
        if not isinstance(rows, (int, np.integer)):
            return self._taken(np.arange(len(self))[rows])
        i = range(len(self))[rows]
        apart = self.apart.get(i)
        if isinstance(apart, Exception):
            raise apart.with_traceback(None)
        if apart is not None:
            return apart
        if self.held is not None and i in self.held[0]:
            return self.held[1][int(np.searchsorted(self.held[0], i))]
        one = super().__getitem__(i)
        lin, robot = self.linearisation, self.posture.robot
        if self.posture.transforms.ndim > 3:
            lin = replace(lin, posture=self.posture[i])
        # The virtual joints of the robot object are cached, so it is kept if the errors
        # are equal.
        if one.errors is not None and not np.array_equal(one.errors, robot.errors):
            robot = robot.with_errors(one.errors)
            lin = replace(lin, posture=replace(lin.posture, robot=robot))
        alone = replace(
            one, linearisation=lin, frame_loads=self.frame_loads[i], errors=None,
            apart={}, held=None,
        )  # fmt: skip
        known = {name: vars(self)[name][i] for name in ("energy", "platform_screw")}
        return with_known(alone, known)

    def _taken(self, rows: NDArray) -> Self:
        """Return a selection of points, possibly with repetitions."""
        lin, held = self.linearisation, self.held
        if self.posture.transforms.ndim > 3:
            lin = replace(lin, posture=self.posture[rows])
        if held is not None:
            own = np.isin(rows, held[0])
            held = np.flatnonzero(own), held[1][np.searchsorted(held[0], rows[own])]
        apart = {
            i: self.apart[k] for i, k in enumerate(rows.tolist()) if k in self.apart
        }
        taken = replace(
            super().__getitem__(rows), linearisation=lin, apart=apart, held=held,
            frame_loads=self.frame_loads[rows],
        )  # fmt: skip
        known = {k: vars(self)[k][rows] for k in KNOWN if k in vars(self)}
        return with_known(taken, known)

    def in_columns(self, joints: VirtualJoints) -> Self:
        """Express the solutions of many points in the columns of other virtual joints.

        Args:
            joints: virtual joints of some points in ``apart``.

        Returns:
            The points; clearances and motions of all other points are NaN.
        """
        parts = {
            "elastic": joints.elastic, "clearances": joints.cones,
            "motions": joints.free,
        }  # fmt: skip
        nu = joints.cones.shape[1]
        rows: dict[str, Any] = {
            name: np.full((len(self), columns.shape[1]), np.nan)
            for name, columns in parts.items()
        }
        for i, one in self.apart.items():
            if isinstance(one, Solution) and one.clearances.shape[-1] == nu:
                for name, values in rows.items():
                    values[i] = getattr(one, name)
        if self.held is not None and self.held[1].clearances.shape[-1] == nu:
            for name, values in rows.items():
                values[self.held[0]] = getattr(self.held[1], name)
        return with_known(replace(self, joints=joints, **rows), vars(self))

    def with_held(
        self, rows: NDArray, joints: VirtualJoints, parts: Mapping[str, NDArray]
    ) -> Self:
        """Store the points at which motion limits of passive joints are active.

        Args:
            rows: sorted indices of these points.
            joints: virtual joints with all motion limits as cones.
            parts: ``clearances`` and ``motions`` of these points in the columns of
                ``joints``.

        Returns:
            All points, with the field ``held`` set.
        """
        some = self._taken(rows)
        own = replace(
            some, joints=joints, clearances=parts["clearances"],
            motions=parts["motions"],
        )  # fmt: skip
        held = rows, with_known(own, vars(some))
        return with_known(replace(self, held=held), vars(self))

    @property
    def as_many(self) -> Self:
        """This solution in the form of a solution at k = 1 points."""
        lin = self.linearisation
        rows: dict[str, Any] = {
            name: np.asarray(getattr(self, name))[None]
            for name in ("energy_without_clearance", *_VECTORS)
        }
        for name in ("method", "status", "reason"):
            rows[name] = np.array([getattr(self, name)], dtype=object)
        at = replace(lin, posture=together([lin.posture]))
        many = replace(self, linearisation=at, **rows)
        names = ("energy", "platform_screw")
        known = {name: np.asarray(getattr(self, name))[None] for name in names}
        return with_known(many, known)


One = TypeVar("One", bound=Solution)


def with_known(solution: One, known: Mapping[str, Any]) -> One:
    """Store known derived values so that they need not be recomputed.

    Args:
        solution: solution of one point or of many points.
        known: known values by name.  Names that are not in :data:`KNOWN` are ignored.

    Returns:
        The same object.
    """
    own = vars(solution)
    for name in KNOWN:
        if name in known:
            own[name] = plain(known[name])
    return solution
