"""Design the configurations, loads and conditions of a synthetic campaign."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.posture import POSE, home_posture, pose_components
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput, checked
from forcefit.validation.synthetic.effects import Row

TEMPERATURES = ("swing", "around", "constant")
_PERIOD = 2400.0  # [s] period of the temperature
_STEP = 60.0  # [s] time between measurements
_DRAWS = 40  # largest number of random draws per configuration
_DIGITS = 6  # number of decimal digits of commanded coordinates
# Attributes of the design that each effect requires to be visible.
_VARIED_FOR: dict[str, dict[str, Any]] = {
    "_humidity": {"humidity": True},
    "_quadratic_temperature": {"temperature": "around"},
    "_tilting": {"tilt": 1e-4},
    "body_mass": {"gravity": 9.81},
}


@dataclass(frozen=True, eq=False)
class CampaignDesign:
    """Design of a synthetic campaign.

    Attributes:
        configurations: number of distinct configurations.
        rows: number of measurements. Successive measurements are in different
            configurations.
        reach: [rad] largest displacement of a revolute drive from its home position.
            For a prismatic drive, this value is multiplied by ``size``.
        size: [m] length by which ``reach`` is multiplied for a prismatic drive.
        load: [N] largest force applied to the platform.
        levels: ``"many"`` for loads of many magnitudes and directions, or ``"one"`` for
            the same force in every row.
        temperature: range of the temperature: ``"swing"`` for -0.5 to 6.5 K,
            ``"around"`` for -4 to 4 K, or ``"constant"`` for 6 K.
        command: type of the commands in the file, ``"joints"`` or ``"pose"``.
        humidity: whether the covariate ``humidity`` [%] is recorded.
        tilt: [rad] magnitude of the covariate ``tilt``; 0 if it is not recorded.
        gravity: [m/s^2] magnitude of the recorded gravity, which acts along -z.
        reference_point: [m] measured point, at which loads act, platform axes.
        corners: whether every drive is at an end of its range in half of the
            configurations.
    """

    configurations: int = 24
    rows: int = 116
    reach: float = 0.6
    size: float = 0.1
    load: float = 40.0
    levels: str = "many"
    temperature: str = "swing"
    command: str = "joints"
    humidity: bool = False
    tilt: float = 0.0
    gravity: float = 0.0
    reference_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    corners: bool = False

    def __post_init__(self) -> None:
        checked("design: reach", self.reach, "rad", above=0)
        checked("design: size", self.size, "m/rad", above=0)
        checked("design: load", self.load, "N", least=0)
        for value in self.reference_point:
            checked("design: reference_point", value, "m")
        choices = (
            ("levels", ("many", "one")),
            ("temperature", TEMPERATURES),
            ("command", ("joints", "pose")),
        )
        for name, valid in choices:
            if getattr(self, name) not in valid:
                raise BadInput(
                    f'design: {name}: found "{getattr(self, name)}", expected '
                    + " | ".join(valid)
                )
        if not 0 < self.configurations <= self.rows:
            raise BadInput(
                f"design: found {self.configurations} configurations in {self.rows} "
                "rows; expected at least one configuration and at least as many rows"
            )


def varied_for(design: CampaignDesign, names: Iterable[str]) -> CampaignDesign:
    """Return a design that varies the covariates on which effects depend.

    Args:
        design: initial design.
        names: names of the effects.

    Returns:
        The design, in which these covariates vary.
    """
    given = {key: v for n in names for key, v in _VARIED_FOR.get(n, {}).items()}
    return replace(design, **given)


@dataclass(frozen=True, eq=False)
class CampaignPlan:
    """Rows of a design, planned for a robot.

    Attributes:
        rows: rows in measuring order.
        configuration: (rows,) index of the configuration of each row.
        commands: (rows, m) commands in the file.
        columns: names of the m columns.
    """

    rows: tuple[Row, ...]
    configuration: NDArray
    commands: NDArray
    columns: tuple[str, ...] = field(default_factory=tuple)


def plan_campaign(
    robot: Robot, design: CampaignDesign, rng: np.random.Generator
) -> CampaignPlan:
    """Draw random configurations, loads and conditions.

    Args:
        robot: the declared robot.
        design: design of the campaign.
        rng: random number generator.

    Returns:
        The plan.

    Raises:
        BadInput: the loops can be closed in too few configurations within the reach.
    """
    coordinates = _configurations(robot, design, rng)
    commands, columns, coordinates = _commands(robot, design, coordinates)
    order = _interleaved(design, rng)
    loads = _loads(design, order, rng)
    count = design.rows
    time = np.cumsum(np.r_[0.0, _STEP * rng.uniform(0.7, 1.3, count - 1)]).round(1)
    conditions = {
        "temperature": _temperature(design, time, rng),
        "time": time,
        "approach": rng.choice([-1.0, 1.0], count),
    }
    if design.humidity:
        phase = rng.uniform(0, 2 * np.pi)
        humidity = 40 + 8 * np.sin(2 * np.pi * time / 4100 + phase)
        conditions["humidity"] = (humidity + rng.normal(0, 0.5, count)).round(1)
    if design.tilt:
        slow = np.cumsum(rng.normal(size=count))
        conditions["tilt"] = design.tilt * (slow - slow[0]) / np.ptp(slow)
    if design.gravity:
        conditions["gravity.z"] = np.full(count, -design.gravity)
    names = [frame.name for frame in robot.frames]
    rows = tuple(
        Row(
            dict(zip(names, coordinates[order[i]].tolist(), strict=True)),
            loads[i],
            {name: float(values[i]) for name, values in conditions.items()},
        )
        for i in range(count)
    )
    return CampaignPlan(rows, order, commands[order], columns)


def _configurations(
    robot: Robot, design: CampaignDesign, rng: np.random.Generator
) -> NDArray:
    """Return joint coordinates that close the loops of the nominal robot, (k, n)."""
    home = home_posture(robot)
    spans = np.array([
        0.0 if not f.actuated
        else design.reach * (design.size if f.joint == "prismatic" else 1.0)
        for f in robot.frames
    ])  # fmt: skip
    actuated = np.array([f.actuated for f in robot.frames])
    reachable: list[NDArray] = []
    for _ in range(_DRAWS):
        draws = rng.uniform(-1, 1, (design.configurations, len(spans)))
        if design.corners:
            draws[::2] = np.sign(draws[::2])
        commanded = (home.coordinates + spans * draws).round(_DIGITS)
        target = Target(coordinates=np.where(actuated, commanded, np.nan))
        track = follow(robot, home.coordinates, target)
        closed = track.reached & (track.mismatch < 1e-9)
        reachable += list(track.coordinates[closed])
        if len(reachable) >= design.configurations:
            return np.array(reachable[: design.configurations])
    raise BadInput(
        f"{robot.name}: the loops can be closed in too few configurations within "
        f"{design.reach:g} rad of the home position; expected a smaller reach"
    )


def _commands(
    robot: Robot, design: CampaignDesign, coordinates: NDArray
) -> tuple[NDArray, tuple[str, ...], NDArray]:
    """Return the commands for the file, their columns and the coordinates."""
    driven = [i for i, f in enumerate(robot.frames) if f.actuated]
    if design.command == "joints":
        columns = tuple(f"q.{robot.frames[i].name}" for i in driven)
        return coordinates[:, driven], columns, coordinates
    home = home_posture(robot).coordinates
    held = Target(coordinates=coordinates)
    T = follow(robot, home, held).transforms[:, robot.index(robot.platform)]
    poses = pose_components(T).round(_DIGITS)
    track = follow(robot, home, Target(pose=poses))
    if not track.reached.all():
        raise BadInput(
            f"{robot.name}: a full platform pose cannot be commanded; expected a robot "
            'with six degrees of freedom, or command = "joints"'
        )
    return poses, tuple(f"pose.{name}" for name in POSE), track.coordinates


def _interleaved(design: CampaignDesign, rng: np.random.Generator) -> NDArray:
    """Return the configuration of each row.

    All configurations are measured in random order. The order changes at each
    repetition.
    """
    passes = -(-design.rows // design.configurations)
    orders = [rng.permutation(design.configurations) for _ in range(passes)]
    return np.concatenate(orders)[: design.rows]


def _loads(design: CampaignDesign, order: NDArray, rng: np.random.Generator) -> NDArray:
    """Return loads of all rows, with repeated loads, (rows, 6) [N m, N]."""
    loads = np.zeros((design.rows, 6))
    if design.levels == "one":
        loads[:, 3:] = (design.load * _direction(rng)).round(3)
        return loads
    for configuration in range(design.configurations):
        visits = np.flatnonzero(order == configuration)
        fresh = max(len(visits) - 2, 1)
        drawn = [_load(design.load, rng) for _ in range(fresh)]
        if configuration % 2:
            drawn[rng.integers(fresh)] = np.zeros(3)
        again = [drawn[rng.integers(fresh)] for _ in range(len(visits) - fresh)]
        forces = np.array([*drawn, *again])
        loads[visits, 3:] = forces[rng.permutation(len(visits))]
    return loads


def _load(largest: float, rng: np.random.Generator) -> NDArray:
    """Return a random force (3,) [N]."""
    if rng.random() < 0.5:
        axis = np.zeros(3)
        axis[rng.integers(3)] = rng.choice([-1.0, -0.5, 0.5, 1.0])
        return largest * axis
    return (largest * rng.uniform(0.4, 1.0) * _direction(rng)).round(3)


def _direction(rng: np.random.Generator) -> NDArray:
    """Return a random unit vector (3,)."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def _temperature(
    design: CampaignDesign, time: NDArray, rng: np.random.Generator
) -> NDArray:
    """Return the temperature of each row, (rows,) [K]."""
    if design.temperature == "constant":
        return np.full(len(time), 6.0)
    middle, size = (3.0, 3.5) if design.temperature == "swing" else (0.0, 4.0)
    phase = rng.uniform(0, 2 * np.pi)
    wave = middle + size * np.sin(2 * np.pi * time / _PERIOD + phase)
    return (wave + rng.normal(0, 0.05, len(time))).round(2)
