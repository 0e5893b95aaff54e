"""Operating conditions of past or planned measurements of a robot.

An *effect* (:mod:`forcefit.assembly.effects`) is a property that the robot file does
not contain, such as friction or thermal expansion.  An effect changes only fields of
:class:`Conditions`.  Effects can therefore be combined, and
:func:`forcefit.assembly.measurement.predict.predict` does not depend on them.

======  ====================  =========  =============================================
symbol  code                  shape      meaning
======  ====================  =========  =============================================
T       ``transforms``        (R,n,4,4)  nominal frames seen from the base
dl      ``errors``            (R, n, 6)  stress-free screws, frame axes
w       ``load``              (R, 6)     wrench on the platform at ``point``, base axes
g       ``gravity``           (R, 3)     gravity vector, base axes
======  ====================  =========  =============================================
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.measurement.history import History
from forcefit.assembly.model.robot import Robot
from forcefit.results.display import html_table, short_repr

COVARIATES = ("temperature", "time", "approach")


@dataclass(frozen=True)
class ContactLaw:
    """Contact spring in series with a joint, with load = coefficient |deflection|^n.

    The spring acts along or about the joint's z axis in both directions.

    Attributes:
        frame: name of the joint.
        coefficient: [N/m^n or N m/rad^n] coefficient, > 0.
        exponent: [-] exponent n > 1; 1.5 for Hertz contact of two spheres.
    """

    frame: str
    coefficient: float
    exponent: float


@dataclass(frozen=True, eq=False)
class Yield:
    """Deflection law: a deflection at a frame that is a function of wrenches.

    Attributes:
        frame: name of the frame.
        component: index of the deflected screw component in frame axes, 0 to 5; 6 for
            the motion along the thread of a helical joint.
        through: frame and component index of each wrench component on which the law
            depends.
        inputs: (R, k) additional inputs of the law, one row per measurement.
        law: smooth function [rad or m] of the inputs (R, k) and wrenches (R, s).
        linear: whether the law is a compliance times one wrench component at the same
            frame.
    """

    frame: str
    component: int
    through: tuple[tuple[str, int], ...]
    inputs: NDArray
    law: Callable[[NDArray, NDArray], NDArray]
    linear: bool = False


@dataclass(frozen=True, eq=False)
class Conditions:
    """Operating conditions of R measurements of one robot, possibly with effects.

    Attributes:
        robot: robot of n frames, with the same links, springs and clearances in all
            measurements.
        coordinates: (R, n) [rad or m] commanded coordinates of all joints.
        transforms: (R, n, 4, 4) frames in the base frame, without imperfections.
        mismatch: (R,) [rad, m] largest nominal closure error, which is neglected.
        errors: (R, n, 6) [rad, m] stress-free screws of the frames: geometric errors,
            including changes due to effects.
        point: (3,) [m] reference point at which the load acts, platform axes.
        load: (R, 6) [N m, N] wrenches on the platform at the reference point, base
            axes.
        gravity: (R, 3) [m/s^2] gravity vectors in base axes.
        temperature: (R,) [K] temperature above calibration; NaN if unknown.
        time: (R,) [s] time since the first measurement; NaN if unknown.
        approach: (R,) direction from which the position was approached, -1 or 1; NaN if
            unknown.
        covariates: (R,) values of additional covariates by name.
        session: (R,) names of the sessions; None if unknown.
        history: all measurements of the campaign in order of time, or None.
        row: (R,) indices of these measurements in ``history``.
        target: (R, 3) [m] measured point, platform axes; None for the reference point.
        laws: contact springs in series with joints.
        yields: deflection laws.
        exact: whether to use the model with finite motions instead of the linear one.
        second_order: (R, 6) [rad, m] exact minus linear platform screw without load;
            see :func:`forcefit.assembly.measurement.predict.with_second_order`.
        rest: (R, n, 6) fixed positions of the joints within their clearances, relative
            to the bounds; None to compute the positions by minimum energy.
        base: (6,) or (R, 6) [rad, m] rotation and translation of the measuring frame.
            The measured pose is multiplied by this transform from the left.
        tool: (3,) or (R, 3) [m] vector from the reference point to the measured point,
            platform axes.
        reading: (R, 6) [rad, m] offsets that the device adds to the measured pose.
    """

    robot: Robot
    coordinates: NDArray
    transforms: NDArray
    mismatch: NDArray
    errors: NDArray
    point: NDArray
    load: NDArray
    gravity: NDArray
    temperature: NDArray
    time: NDArray
    approach: NDArray
    covariates: Mapping[str, NDArray] = field(default_factory=dict)
    session: NDArray | None = None
    history: History | None = None
    row: NDArray | None = None
    target: NDArray | None = None
    laws: tuple[ContactLaw, ...] = ()
    yields: tuple[Yield, ...] = ()
    exact: bool = False
    second_order: NDArray | float = 0.0
    rest: NDArray | None = None
    base: NDArray = field(default_factory=lambda: np.zeros(6))
    tool: NDArray = field(default_factory=lambda: np.zeros(3))
    reading: NDArray | float = 0.0

    __repr__, _repr_html_ = short_repr, html_table

    def __len__(self) -> int:
        return len(self.transforms)

    @property
    def reads_otherwise(self) -> bool:
        """Whether the registration or a device error changes the readings."""
        return bool(self.base.any() or self.tool.any() or np.any(self.reading))

    @property
    def postures(self) -> Posture:
        """Nominal postures as one object with a leading axis of length R."""
        return Posture(self.robot, self.coordinates, self.transforms, self.mismatch)

    def posture(self, row: int) -> Posture:
        """Return the posture of one measurement, for the robot with its errors."""
        return Posture(
            self.robot.with_errors(self.errors[row]), self.coordinates[row],
            self.transforms[row], float(self.mismatch[row]),
        )  # fmt: skip

    @property
    def measured_points(self) -> NDArray:
        """Nominal positions of the measured point in base axes, (R, 3) [m]."""
        T = self.postures.platform
        return T[:, :3, 3] + self.measured_arms

    @property
    def measured_arms(self) -> NDArray:
        """Vectors from the platform origin to the measured points, (R, 3) [m]."""
        at = self.point if self.target is None else self.target
        if not at.any():
            return np.zeros((len(self), 3))
        return (self.postures.platform[:, :3, :3] @ at[..., None])[..., 0]

    def load_at_origin(self) -> NDArray:
        """Return the load at the platform's origin in base axes, (R, 6) [N m, N]."""
        moved = self.load.copy()
        if self.point.any():
            arm = self.postures.platform[:, :3, :3] @ self.point
            moved[:, :3] += np.cross(arm, self.load[:, 3:])
        return moved

    def take(self, rows: ArrayLike) -> "Conditions":
        """Select measurements.

        Args:
            rows: indices or a mask.

        Returns:
            The conditions of the selected measurements.
        """
        index = np.asarray(rows)
        kept = {name: getattr(self, name)[index] for name in _BY_ROW}
        for name in ("reading", "second_order", "base", "tool"):
            values = getattr(self, name)
            if np.ndim(values) == 2:
                kept[name] = values[index]
        for name in ("rest", "session", "row", "target"):
            values = getattr(self, name)
            kept[name] = None if values is None else values[index]
        kept["covariates"] = {k: v[index] for k, v in self.covariates.items()}
        kept["yields"] = tuple(replace(y, inputs=y.inputs[index]) for y in self.yields)
        return replace(self, **kept)


_BY_ROW = (
    "coordinates", "transforms", "mismatch", "errors", "load", "gravity",
    "temperature", "time", "approach",
)  # fmt: skip


def as_declared(
    postures: Posture,
    load: ArrayLike | None = None,
    *,
    mismatch: ArrayLike = 0.0,
    point: ArrayLike = (0.0, 0.0, 0.0),
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    covariates: Mapping[str, ArrayLike] | None = None,
    target: ArrayLike | None = None,
) -> Conditions:
    """Create the conditions of a robot without additional effects.

    Args:
        postures: one posture, or R postures in one object.
        load: (6,) or (R, 6) [N m, N] wrench at the reference point, base axes; None for
            no load.
        mismatch: (R,) [rad, m] nominal closure error.
        point: (3,) [m] reference point, platform axes.
        gravity: (3,) or (R, 3) [m/s^2] gravity vector in base axes.
        covariates: (R,) values, or a common value, by name: ``temperature`` [K],
            ``time`` [s], ``approach`` -1 or 1, NaN if unknown; any additional
            covariates; and ``session``, a name or (R,) names.
        target: (3,) or (R, 3) [m] measured point, platform axes; by default the
            reference point.

    Returns:
        The conditions of R measurements.
    """
    given = dict.fromkeys(COVARIATES, np.nan) | dict(covariates or {})
    session = given.pop("session", None)
    robot = postures.robot
    n = len(robot.frames)
    T = postures.transforms.reshape(-1, n, 4, 4)
    count = len(T)

    def rows(values: ArrayLike, *shape: int) -> NDArray:
        filled = np.broadcast_to(values, (count, *shape))
        return np.array(filled, dtype=float, order="C")

    return Conditions(
        robot=robot,
        coordinates=postures.coordinates.reshape(-1, n),
        transforms=T,
        mismatch=rows(mismatch),
        errors=rows(robot.errors, n, 6),
        point=np.array(point, dtype=float),
        load=rows(np.zeros(6) if load is None else load, 6),
        gravity=rows(gravity, 3),
        temperature=rows(given.pop("temperature")),
        time=rows(given.pop("time")),
        approach=rows(given.pop("approach")),
        covariates={name: rows(values) for name, values in given.items()},
        session=None if session is None else np.broadcast_to(session, (count,)),
        target=None if target is None else rows(target, 3),
    )
