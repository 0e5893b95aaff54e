"""Conditions of measurements of a robot, past or planned.

An *effect* (:mod:`assembly.effects`) is a property that the model of a robot lacks.  It
changes one or more of the fields below and nothing else.  So any number of effects can
be combined, and :func:`assembly.measurement.predict.predict` needs to know none.

======  ====================  =========  =============================================
symbol  code                  shape      meaning
======  ====================  =========  =============================================
T       ``transforms``        (R,n,4,4)  nominal frames seen from the base
dl      ``errors``            (R, n, 6)  stress-free screws, frame axes
w       ``load``              (R, 6)     on the platform at ``point``, base axes
g       ``gravity``           (R, 3)     base axes
======  ====================  =========  =============================================
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.measurement.history import History
from assembly.model.robot import Robot
from forcefit.results.display import html_table, short_repr

COVARIATES = ("temperature", "time", "approach")


@dataclass(frozen=True)
class ContactLaw:
    """A spring in series with a joint, of the law load = coefficient |deflection|^n.

    Along (about) the joint's own z, equally stiff in both directions.

    Attributes:
        frame: the joint's name.
        coefficient: [N/m^n or N m/rad^n] > 0.
        exponent: [-] n > 1; 1.5 is Hertz's for two spheres.
    """

    frame: str
    coefficient: float
    exponent: float


@dataclass(frozen=True, eq=False)
class Yield:
    """A compliant place: a deflection that follows from wrenches by a given law.

    Attributes:
        frame: name of the frame.
        component: row of the frame's screw that it changes, in the frame's axes.
        through: frames and rows of the wrenches in its law.
        inputs: (R, k) other inputs of the law, row by row.
        law: [rad or m] function of the inputs (R, k) and wrenches (R, s); by row,
            smooth.
        linear: whether it is a spring: a compliance times one wrench, at its place.
    """

    frame: str
    component: int
    through: tuple[tuple[str, int], ...]
    inputs: NDArray
    law: Callable[[NDArray, NDArray], NDArray]
    linear: bool = False


@dataclass(frozen=True, eq=False)
class Conditions:
    """R rows of conditions of one robot; without effects, as its file declares it.

    Attributes:
        robot: robot of n frames; its links, springs and clearances are those of all
            rows.
        coordinates: (R, n) [rad or m] commanded, of every joint.
        transforms: (R, n, 4, 4) frames seen from the base, without imperfections.
        mismatch: (R,) [rad, m] nominal closure error left.
        errors: (R, n, 6) [rad, m] stress-free screws.
        point: (3,) [m] reference point: loaded, platform axes.
        load: (R, 6) [N m, N] on the platform at the reference point, base axes.
        gravity: (R, 3) [m/s^2] base axes.
        temperature: (R,) [K] above that of calibration; NaN where not known.
        time: (R,) [s] since the first measurement; NaN where not known.
        approach: (R,) -1 or 1; NaN where not known.
        covariates: (R,) each, further ones by name.
        session: (R,) names of the sessions; None where not known.
        history: rows of a campaign in the order of measurement, including these; None
            without a past.
        row: (R,) indices of these rows in the history.
        target: (R, 3) [m] the point measured, platform axes; None for the reference
            point.
        laws: contact springs in series with joints.
        yields: compliant places with laws of their own.
        exact: finite motions instead of the linear model.
        second_order: (R, 6) [rad, m] exact minus linear platform screw without load;
            see :func:`assembly.measurement.predict.with_second_order`.
        rest: (R, n, 6) rest positions of the clearances, in units of their bounds; None
            where they follow from the least energy.
        base: (6,) or (R, 6) [rad, m] rotation and shift of the measuring frame, acting
            on the left.
        tool: (3,) or (R, 3) [m] from the reference point to the one measured, platform
            axes.
        reading: (R, 6) [rad, m] to be added to the reading.
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
        """Whether a reading differs from the pose error of the reference point."""
        return bool(self.base.any() or self.tool.any() or np.any(self.reading))

    @property
    def postures(self) -> Posture:
        """All nominal postures as one object, its arrays with R rows."""
        return Posture(self.robot, self.coordinates, self.transforms, self.mismatch)

    def posture(self, row: int) -> Posture:
        """Return the posture of one row, of the robot with that row's errors."""
        return Posture(
            self.robot.with_errors(self.errors[row]), self.coordinates[row],
            self.transforms[row], float(self.mismatch[row]),
        )  # fmt: skip

    @property
    def measured_points(self) -> NDArray:
        """(R, 3) [m] nominal positions of the points measured, base axes."""
        T = self.postures.platform
        return T[:, :3, 3] + self.measured_arms

    @property
    def measured_arms(self) -> NDArray:
        """(R, 3) [m] from the platform's nominal origin to the points measured."""
        at = self.point if self.target is None else self.target
        if not at.any():
            return np.zeros((len(self), 3))
        return (self.postures.platform[:, :3, :3] @ at[..., None])[..., 0]

    def load_at_origin(self) -> NDArray:
        """Return the (R, 6) [N m, N] load read at the platform's origin, base axes."""
        moved = self.load.copy()
        if self.point.any():
            arm = self.postures.platform[:, :3, :3] @ self.point
            moved[:, :3] += np.cross(arm, self.load[:, 3:])
        return moved

    def take(self, rows: ArrayLike) -> "Conditions":
        """Return a selection of the rows.

        Args:
            rows: indices or a mask.

        Returns:
            The conditions of those rows only.
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
    """Return the conditions of a robot as its file declares it.

    Args:
        postures: one, or many with arrays of R rows.
        load: (6,) or (R, 6) [N m, N] at the reference point, base axes; none if absent.
        mismatch: (R,) [rad, m] nominal closure error left.
        point: (3,) [m] the reference point, platform axes.
        gravity: (3,) or (R, 3) [m/s^2] base axes.
        covariates: (R,) or one number for all rows, by name: ``temperature`` [K],
            ``time`` [s], ``approach`` -1 or 1, NaN if absent; any others; and
            ``session``, its name or (R,) names.
        target: (3,) or (R, 3) [m] the point measured, platform axes; the reference
            point if absent.

    Returns:
        R rows.
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
