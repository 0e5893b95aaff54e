"""Generate synthetic campaigns of a simulated machine with hidden effects.

The machine is simulated in Exudyn with finite rotations and geometrically exact beams,
independently of the model that is fitted later.  Each effect is scaled so that the rms
of its contribution to the readings is the requested multiple of the noise.  The effects
of weight and of geometric stiffening cannot be scaled. For these effects, the noise is
adjusted instead.

The campaign folder contains only data that a measurement would provide.  Hidden effects
are stored separately, in the truth format of the practice campaigns.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput, checked
from forcefit.inputs.writing import whole_folder, write_text
from forcefit.results.display import html_table, short_repr
from forcefit.validation.synthetic.design import (
    CampaignDesign,
    CampaignPlan,
    plan_campaign,
)
from forcefit.validation.synthetic.draws import NotApplicable, draw_effect, strengthened
from forcefit.validation.synthetic.effects import SCREW, WRENCH, Row
from forcefit.validation.synthetic.machine import Hidden, simulate_readings

_GIVEN_STRENGTH = ("self_weight", "geometric_stiffening")
_TRIES = 5
_DRAWS = 6  # largest number of random draws of an effect's parameters
_CLOSE = 0.05  # accepted relative error of an effect's requested strength
_MOST = 1000.0  # largest accepted factor on the plausible size of an effect
# Factor on the errors and the load that makes readings nearly linear in them.
_SMALL = 1e-2
_BLUNDER = 40.0  # [sigma] size of a blunder

Progress = Callable[[str, int, int], None]
Draw = Callable[[str], Hidden]


@dataclass(frozen=True, eq=False)
class Synthetic:
    """A synthetic campaign and its hidden effects.

    Attributes:
        robot: the declared robot.
        plan: the commands.
        reference_point: (3,) [m] measured point, platform axes.
        registration: ``"known"``, or ``"unknown"`` with a hidden measuring frame.
        sigma: (6,) [rad, m] standard deviation of the noise.
        readings: (rows, 6) [rad, m] measured deviations; NaN for missing values.
        exact: (rows, 6) [rad, m] deviations without noise and without blunders.
        added: (rows, 6) [rad, m] contribution of the hidden effects, without the error
            of the measuring frame.
        effects: hidden effects with their parameters.
        strength: mapping from the name of each effect to the rms of its contribution
            [sigma].
        outliers: rows that contain a blunder.
        hidden_base: (6,) [rad, m] error of the measuring frame; None if the pose of the
            frame is known.
    """

    robot: Robot
    plan: CampaignPlan
    reference_point: NDArray
    registration: str
    sigma: NDArray
    readings: NDArray
    exact: NDArray
    added: NDArray
    effects: tuple[Hidden, ...]
    strength: Mapping[str, float]
    outliers: tuple[int, ...] = ()
    hidden_base: NDArray | None = None

    __repr__, _repr_html_ = short_repr, html_table


@dataclass(frozen=True, eq=False)
class Noise:
    """Errors of the readings.

    Attributes:
        rotation: [rad] standard deviation of rotations.
        position: [m] standard deviation of positions.
        outliers: number of rows that contain a blunder.
        missing: fraction of missing values.
        hidden_frame: [rad, m] largest error of each component of the measuring frame's
            pose; 0 if the pose is known.
    """

    rotation: float = 1e-5
    position: float = 5e-6
    outliers: int = 0
    missing: float = 0.0
    hidden_frame: float = 0.0

    def __post_init__(self) -> None:
        checked("noise: rotation", self.rotation, "rad", above=0)
        checked("noise: position", self.position, "m", above=0)
        checked("noise: outliers", self.outliers, "rows", least=0)
        checked("noise: missing", self.missing, "1", least=0, below=1)
        checked("noise: hidden_frame", self.hidden_frame, "rad, m", least=0)

    @property
    def sigma(self) -> NDArray:
        """Standard deviations of the components, (6,) [rad, m]."""
        return np.repeat([self.rotation, self.position], 3)


def generate_campaign(
    robot: Robot,
    wanted: Mapping[str, float] | Sequence[tuple[Hidden, float]],
    design: CampaignDesign | None = None,
    noise: Noise | None = None,
    seed: int = 0,
    program: str = "multibody",
    update: Progress | None = None,
) -> Synthetic:
    """Simulate a campaign on a machine with hidden effects.

    Args:
        robot: the declared robot; its geometric errors are known.
        wanted: pairs of an effect and its requested strength, as a multiple of the
            noise.  The parameters are random if only the name of an effect is given.
        design: design of the campaign.
        noise: errors of the readings.
        seed: random seed.
        program: ``"multibody"``, or ``"springs"``, which is much faster.
        update: function called with the stage, the number of finished rows and the
            total number.

    Returns:
        The campaign.

    Raises:
        BadInput: an effect is unknown, there are more blunders than rows, or the robot
            cannot execute the design.
        NotApplicable: an effect does not apply to the robot, or is hardly visible in
            every draw.
        SimulationFailed: no equilibrium was found for a row.
    """
    design, noise = design or CampaignDesign(), noise or Noise()
    if noise.outliers > design.rows:
        raise BadInput(
            f"noise: outliers: found {noise.outliers}, expected at most the "
            f"{design.rows} rows of the design"
        )
    rng = np.random.default_rng(seed)
    point = np.array(design.reference_point, dtype=float)
    plan = plan_campaign(robot, design, rng)
    duration = plan.rows[-1].covariates["time"]
    redraw: Draw | None = None
    if isinstance(wanted, Mapping):
        redraw = partial(draw_effect, robot=robot, duration=duration, rng=rng)
        drawn = {name: redraw(name) for name in wanted}
        wanted = [(drawn[name], multiple) for name, multiple in wanted.items()]
    machine = _SimulatedMachine(robot, point, plan.rows, program, update)
    shown = _shown_effects(machine, wanted, noise.sigma, redraw)
    exact = shown.exact
    base = noise.hidden_frame * rng.uniform(-1, 1, 6) if noise.hidden_frame else None
    if base is not None:
        keys = (f"base.{k}" for k in SCREW)
        frame = Hidden("registration", dict(zip(keys, base.tolist(), strict=True)))
        exact = machine.read([*shown.effects, frame], "hidden frame")
    readings, outliers = _measured(exact, shown.sigma, noise, rng)
    return Synthetic(
        robot=robot,
        plan=plan,
        reference_point=point,
        registration="known" if base is None else "unknown",
        sigma=shown.sigma,
        readings=readings,
        exact=exact,
        added=shown.exact - shown.declared,
        effects=shown.effects,
        strength=shown.strength,
        outliers=outliers,
        hidden_base=base,
    )


@dataclass(frozen=True, eq=False)
class _Shown:
    """Scaled hidden effects and the readings that they cause.

    Attributes:
        effects: effects with their parameters.
        strength: mapping from the name of each effect to the rms of its contribution
            [sigma].
        declared: (rows, 6) [rad, m] readings without the effects.
        exact: (rows, 6) [rad, m] readings with all effects.
        sigma: (6,) [rad, m] standard deviation of the noise.
    """

    effects: tuple[Hidden, ...]
    strength: dict[str, float]
    declared: NDArray
    exact: NDArray
    sigma: NDArray


@dataclass(eq=False)
class _SimulatedMachine:
    """A simulated robot and the rows of a design."""

    robot: Robot
    point: NDArray
    rows: Sequence[Row]
    program: str
    update: Progress | None

    def read(self, effects: Sequence[Hidden], stage: str) -> NDArray:
        """Return the noise-free readings of all rows."""
        update = self.update
        progress = None if update is None else (lambda d, n: update(stage, d, n))
        return simulate_readings(
            self.robot, self.point, self.rows, effects, self.program, progress
        )


def _shown_effects(
    machine: _SimulatedMachine, wanted: Sequence[tuple[Hidden, float]], sigma: NDArray,
    redraw: Draw | None,
) -> _Shown:  # fmt: skip
    """Scale each effect to its requested multiple of the noise."""
    # Effects of fixed strength determine the noise, so they are processed first.
    wanted = sorted(wanted, key=lambda pair: pair[0].name not in _GIVEN_STRENGTH)
    declared = machine.read((), "declared")
    if any(effect.name == "geometric_stiffening" for effect, _ in wanted):
        declared = _linear(machine)
    exact = declared
    effects, strength = [], {}
    for effect, multiple in wanted:
        effect, exact, sigma = _shown_effect(
            machine, effect, multiple, sigma, declared, redraw
        )
        effects.append(effect)
        strength[effect.name] = _rms((exact - declared) / sigma)
    if len(effects) > 1:
        exact = machine.read(effects, "all effects")
    return _Shown(tuple(effects), strength, declared, exact, sigma)


def _shown_effect(
    machine: _SimulatedMachine, effect: Hidden, multiple: float, sigma: NDArray,
    declared: NDArray, redraw: Draw | None,
) -> tuple[Hidden, NDArray, NDArray]:  # fmt: skip
    """Scale an effect, with new random parameters if it is hardly visible."""
    # An effect may be invisible for some parameters.  For example, a force does not
    # load the spring of a drive if the drive axis intersects the line of the force.
    for _ in range(_DRAWS - 1):
        try:
            return _scaled_effect(machine, effect, multiple, sigma, declared)
        except NotApplicable:
            if redraw is None:
                raise
            effect = redraw(effect.name)
    return _scaled_effect(machine, effect, multiple, sigma, declared)


def _scaled_effect(
    machine: _SimulatedMachine,
    effect: Hidden,
    multiple: float,
    sigma: NDArray,
    declared: NDArray,
) -> tuple[Hidden, NDArray, NDArray]:
    """Return the scaled effect, the readings with it, and the noise."""
    factor = 1.0
    for attempt in range(_TRIES):
        tried = strengthened(effect, factor) if attempt else effect
        exact = machine.read([tried], f"{effect.name}, strength {factor:.3g}")
        reached = _rms((exact - declared) / sigma)
        if reached == 0.0:
            raise NotApplicable(
                f"{effect.name}: found no influence on any reading; choose a different "
                "effect"
            )
        if effect.name in _GIVEN_STRENGTH:
            return tried, exact, sigma * (reached / multiple)
        if abs(reached / multiple - 1.0) < _CLOSE:
            break
        factor *= multiple / reached
        if factor > _MOST:
            raise NotApplicable(
                f"{effect.name}: a contribution of {multiple:g} times the noise "
                f"requires more than {_MOST:g} times the plausible size of the "
                "effect, because the effect hardly changes the readings of this robot "
                "under these loads; choose a different effect"
            )
    return tried, exact, sigma


def _linear(machine: _SimulatedMachine) -> NDArray:
    """Return readings of a machine with small errors and load, (rows, 6)."""
    ends = []
    for scale in (_SMALL, -_SMALL):
        small = machine.robot.with_errors(scale * machine.robot.errors)
        rows = [replace(row, load=scale * row.load) for row in machine.rows]
        ends.append(replace(machine, robot=small, rows=rows).read((), "linear model"))
    return (ends[0] - ends[1]) / (2 * _SMALL)


def _measured(
    exact: NDArray, sigma: NDArray, noise: Noise, rng: np.random.Generator
) -> tuple[NDArray, tuple[int, ...]]:
    """Return readings with noise, blunders and missing values, and blunder rows."""
    readings = exact + sigma * rng.normal(size=exact.shape)
    blunders = rng.choice(len(exact), noise.outliers, replace=False)
    columns = rng.integers(6, size=noise.outliers)
    readings[blunders, columns] += _BLUNDER * sigma[columns]
    gaps = rng.random(exact.shape) < noise.missing
    gaps[gaps.all(axis=1)] = False
    readings[gaps] = np.nan
    return readings, tuple(sorted(blunders.tolist()))


def _rms(values: NDArray) -> float:
    """Return the root mean square of all measured values."""
    return float(np.sqrt(np.nanmean(values**2)))


def write_campaign(campaign: Synthetic, folder: Path | str) -> None:
    """Write campaign.toml, measurements.csv and robot.toml.

    No file is written if an error occurs.

    Args:
        campaign: campaign to write.  Its hidden effects are not written.
        folder: new or empty folder.

    Raises:
        BadInput: the folder is not empty or cannot be written.
    """
    with whole_folder(folder) as part:
        write_robot(campaign.robot, part / "robot.toml")
        write_text(_toml(campaign), part / "campaign.toml")
        write_text(_table(campaign), part / "measurements.csv")


def _toml(campaign: Synthetic) -> str:
    """Return the text of campaign.toml."""
    return (
        'robot = "robot.toml"\n'
        'measurements = "measurements.csv"\n'
        f"reference_point = {campaign.reference_point.tolist()}\n"
        f'registration = "{campaign.registration}"\n\n'
        "[noise]\n"
        f"rotation = {campaign.sigma[0]:.6g}\n"
        f"position = {campaign.sigma[3]:.6g}\n"
    )


def _table(campaign: Synthetic) -> str:
    """Return the text of measurements.csv."""
    plan = campaign.plan
    loads = np.array([row.load for row in plan.rows])
    loaded = [k for k in range(6) if loads[:, k].any()]
    covariates = list(plan.rows[0].covariates)
    header = [
        "id",
        *plan.columns,
        *(f"load.{WRENCH[k]}" for k in loaded),
        *(f"meas.{name}" for name in SCREW),
        *(f"cov.{name}" for name in covariates),
    ]
    lines = [",".join(header)]
    for i, row in enumerate(plan.rows):
        measured = campaign.readings[i]
        cells = [f"m{i + 1:03d}"]
        cells += [f"{v:.10g}" for v in (*plan.commands[i], *row.load[loaded])]
        cells += ["" if np.isnan(v) else f"{v:.8e}" for v in measured]
        cells += [f"{row.covariates[name]:.10g}" for name in covariates]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"
