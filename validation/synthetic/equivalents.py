"""Find effects that a design cannot distinguish from the hidden effects.

The signature of an effect is the first-order change of the readings, divided by the
noise.  It is computed by ``springs.py``, independently of the model under test.  A set
of effects explains the data as well as the hidden effects if a linear combination of
its signatures equals the contribution of the hidden effects within the noise. Such a
set is accepted as the result of a diagnosis.

Clearance and geometric stiffening are omitted, because they have no linear signature.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BeamLink
from forcefit.validation.synthetic.delays import behind, with_delays
from forcefit.validation.synthetic.effects import SCREW, WRENCH, Row, own_compliance
from forcefit.validation.synthetic.generator import Synthetic
from forcefit.validation.synthetic.machine import Hidden, simulate_readings

SAME = 10.0  # residual chi-square below which two sets of effects are equivalent
# Assumed time constants of a drift, relative to the duration of the campaign.
_DRIFTS = (0.1, 0.3, 1.0)
_STEP = 1e-5  # [rad, m] step of a finite difference
_GRAM = 1e-3  # [kg, kg m] step of finite differences for masses and first moments
MOMENTS = ("moment.x", "moment.y", "moment.z")
_SOFT = 1e9  # [N m/rad, N/m] stiffness of a spring added for a finite difference


@dataclass(frozen=True, eq=False)
class Alternative:
    """A set of effects that is compared with the hidden effects.

    Attributes:
        names: names of the effects.
        parameters: number of their parameters.
        residual: [-] chi-square of the contribution of the hidden effects after fitting
            this set to it.
    """

    names: tuple[str, ...]
    parameters: int
    residual: float


def alternatives(campaign: Synthetic, size: int = 1) -> list[Alternative]:
    """Return all small sets of public effects, with the best set first.

    Args:
        campaign: campaign with its hidden effects.
        size: largest number of effects in a set.

    Returns:
        The sets with their residuals.
    """
    known = np.isfinite(campaign.readings)
    target = (campaign.added / campaign.sigma)[known]
    columns = {n: c[known.ravel()] for n, c in signatures(campaign).items()}
    frame = columns["registration"][:, :6]
    nuisance = frame if campaign.registration == "unknown" else frame[:, :0]
    sets = []
    for count in range(1, size + 1):
        for names in combinations(columns, count):
            if len({name.partition("(")[0] for name in names}) < count:
                continue
            A = np.hstack([nuisance, *(columns[name] for name in names)])
            sets.append(Alternative(names, A.shape[1], _residual(A, target)))
    return sorted(sets, key=lambda one: one.residual)


def _residual(A: NDArray, target: NDArray) -> float:
    """Return the squared distance between a vector and the column space of a matrix."""
    norms = np.linalg.norm(A, axis=0)
    A = A[:, norms > 0] / norms[norms > 0]
    if not A.shape[1]:
        return float(target @ target)
    u, size, _ = np.linalg.svd(A, full_matrices=False)
    u = u[:, size > 1e-9 * size[0]]
    remainder = target - u @ (u.T @ target)
    return float(remainder @ remainder)


def signatures(campaign: Synthetic) -> dict[str, NDArray]:
    """Return the signatures of all public effects that apply to the robot.

    Args:
        campaign: campaign with the design and the noise.

    Returns:
        Mapping from each effect to its signatures (6 rows, parameters). For a drift,
        there is one entry for each assumed time constant.
    """
    raw = dict(_raw(campaign))
    sigma = np.tile(campaign.sigma, len(campaign.plan.rows))
    return {
        name: columns.reshape(len(sigma), -1) / sigma[:, None]
        for name, columns in raw.items()
        if columns.size
    }


def _raw(campaign: Synthetic) -> Iterator[tuple[str, NDArray]]:
    """Return the derivatives of the readings for each effect, (rows, 6, parameters)."""
    differences = _FiniteDifferences(campaign)
    covariate = {
        name: np.array([row.covariates[name] for row in campaign.plan.rows])[:, None]
        for name in ("temperature", "time", "approach")
    }
    yield from _of_drives_and_lengths(campaign, differences, covariate)
    yield from _of_loads(campaign, differences)
    yield from _of_the_device(differences, covariate["time"])


def _of_drives_and_lengths(
    campaign: Synthetic, differences: "_FiniteDifferences",
    covariate: Mapping[str, NDArray],
) -> Iterator[tuple[str, NDArray]]:  # fmt: skip
    """Return the signatures of effects that rotate a drive or lengthen a beam."""
    robot, rows = campaign.robot, campaign.plan.rows
    drives = [f.name for f in robot.frames if f.actuated]
    turning = [f.name for f in robot.frames if f.actuated and f.joint == "revolute"]
    beams = [f for f in robot.frames if isinstance(f.link, BeamLink)]
    offsets = {n: differences.unloaded("encoder_offset", n, _STEP) for n in drives}
    bodies = beams or [f for f in robot.frames if f.translation.any()]
    lengths = [differences.unloaded("link_length", f.name, _STEP) for f in bodies]
    softer = {
        n: differences.loaded("drive_compliance", n, _SOFT, 1 / _SOFT) for n in drives
    }
    yield "encoder_offset", _columns(list(offsets.values()))
    angles = {n: np.array([[row.coordinates[n]] for row in rows]) for n in turning}
    waves = [wave(angles[n]) * offsets[n] for n in turning for wave in (np.sin, np.cos)]
    yield "encoder_eccentricity", _columns(waves)
    yield "link_length", _columns(lengths)
    warm = covariate["temperature"]
    yield "thermal_expansion", _columns([warm * length for length in lengths])
    for share in _DRIFTS:
        late = share * float(covariate["time"].max())
        kelvin = [r.covariates[behind(late)] for r in with_delays(rows, [late])]
        slow = np.array(kelvin)[:, None]
        yield f"delayed_expansion({share:g})", _columns([slow * x for x in lengths])
    yield "drive_compliance", _columns(list(softer.values()))
    elastic = [n for n in drives if own_compliance(robot.frame(n)) > 0]
    friction = [covariate["approach"] * offsets[n] for n in elastic]
    yield "friction_hysteresis", _columns(friction)
    stiffening = [_stiffening(softer[n], offsets[n]) for n in drives]
    yield "contact_stiffening", _columns(stiffening)


def _of_loads(
    campaign: Synthetic, differences: "_FiniteDifferences"
) -> Iterator[tuple[str, NDArray]]:
    """Return the signatures of springs, weight and load errors."""
    beams = [f for f in campaign.robot.frames if isinstance(f.link, BeamLink)]
    base = [
        differences.loaded("base_compliance", f"stiffness.{k}", _SOFT, 1 / _SOFT)
        for k in SCREW
    ]
    yield "base_compliance", _columns(base)
    moduli = [differences.loaded("modulus_scale", f.name, 0.99, 0.01) for f in beams]
    yield "modulus_scale", _columns(moduli)
    weights = [differences.unloaded("self_weight", f"g.{k}", 1.0) for k in "xyz"]
    yield "self_weight", _columns(weights)
    unit_loads = [differences.unloaded("load_gain", f"offset.{k}", 1.0) for k in WRENCH]
    loads = np.array([row.load for row in campaign.plan.rows])
    recorded = [k for k in range(6) if loads[:, k].any()]
    gain = sum(loads[:, [k]] * unit_loads[k] for k in range(6))
    yield "load_gain", _columns([np.asarray(gain), *(unit_loads[k] for k in recorded)])
    heavy = [f.name for f in campaign.robot.frames if f.mass]
    if "gravity.z" not in campaign.plan.rows[0].covariates:
        heavy = []
    keys = [f"{n}.{k}" for n in heavy for k in ("mass", *MOMENTS)]
    masses = [differences.unloaded("body_mass", key, _GRAM) for key in keys]
    yield "body_mass", _columns(masses)


def _of_the_device(
    differences: "_FiniteDifferences", time: NDArray
) -> Iterator[tuple[str, NDArray]]:
    """Return the signatures of the device's pose and drift."""
    keys = [*(f"base.{k}" for k in SCREW), "tool.tx", "tool.ty", "tool.tz"]
    frame = [differences.unloaded("registration", key, _STEP) for key in keys]
    yield "registration", _columns(frame)
    one = differences.unloaded("device_scale", "factor", 1.0 + _STEP) * (1 / _STEP + 1)
    yield "device_scale", _columns([one])
    for share in _DRIFTS:
        rise = -np.expm1(-time / (share * time.max()))
        yield f"drift({share:g})", _columns([rise * axis for axis in np.eye(6)])


def _columns(screws: Sequence[NDArray]) -> NDArray:
    """Stack screws along the last axis, (rows, 6, parameters)."""
    return np.stack(screws, axis=-1) if screws else np.zeros((0, 6, 0))


class _FiniteDifferences:
    """Readings of the declared machine, and their derivatives by effect parameters."""

    def __init__(self, campaign: Synthetic) -> None:
        self._robot, self._point = campaign.robot, campaign.reference_point
        self._of = campaign.plan.configuration
        self._rows = list(campaign.plan.rows)
        first = np.unique(self._of, return_index=True)[1]
        self._unloaded = [replace(self._rows[i], load=np.zeros(6)) for i in first]
        self._loaded_readings = self._read(self._rows, ())
        self._unloaded_readings = self._read(self._unloaded, ())

    def _read(self, rows: list[Row], effects: Sequence[Hidden]) -> NDArray:
        return simulate_readings(self._robot, self._point, rows, effects, "springs")

    def loaded(self, name: str, key: str, value: float, step: float) -> NDArray:
        """Return the derivative of the readings by an effect parameter, (rows, 6)."""
        readings = self._read(self._rows, [Hidden(name, {key: value})])
        return (readings - self._loaded_readings) / step

    def unloaded(self, name: str, key: str, step: float) -> NDArray:
        """Return the derivative by an effect parameter without load, (rows, 6)."""
        readings = self._read(self._unloaded, [Hidden(name, {key: step})])
        return ((readings - self._unloaded_readings) / step)[self._of]


def _stiffening(softer: NDArray, offset: NDArray) -> NDArray:
    """Return the signatures of a Hertz contact in a drive, offset x load^(2/3)."""
    # The factor for translations is 2/m, which converts lengths to angles.
    scale = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    a, b = softer * scale, offset * scale
    moments = (a * b).sum(axis=1) / (b * b).sum(axis=1)
    return offset * (np.sign(moments) * np.abs(moments) ** (2 / 3))[:, None]
