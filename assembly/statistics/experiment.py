"""Monte Carlo experiments: error distributions and the quantities to compute."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import without_rounding
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.linear.zone import MARGINS
from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.model.given_load import Load, one_load
from forcefit.assembly.model.link_stress import peak_stresses, stressed_links
from forcefit.assembly.statistics.callout_sources import CalloutSources, Sources
from forcefit.assembly.statistics.clearance_positions import (
    CLEARANCE_MODELS,
    CLEARANCE_STREAM,
    contact_length_of,
    position_clearances,
)
from forcefit.assembly.statistics.linear_response import LinearResponse, linear_response
from forcefit.assembly.statistics.posture_margins import PostureMargins, prepare_margins
from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.statistics.stiffness_spread import draw_stiffnesses
from forcefit.assembly.statistics.worst_clearance import PRECISION, bound_worst_errors
from forcefit.assembly.steps.bolted import CannotBolt, bolt_generators, bolted_errors
from forcefit.inputs.renamed import renamed_fields, warn_renamed
from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr

# required precision of pose error bounds, relative to a limit
_PRECISION = 1e-3


@renamed_fields(clearance_model="clearance")
@dataclass(frozen=True, eq=False)
class Experiment:
    """Error distributions at a posture, and the quantities to compute for each draw.

    Attributes:
        posture: posture of the robot; random errors replace those in the robot file.
        sources: distributions of the errors.
        seed: seed of all draws.
        clearance: one of
            :data:`forcefit.assembly.statistics.clearance_positions.CLEARANCE_MODELS`.
        margins: whether the assembly margins, eq. (21), are computed.
        stress: whether the stress of the links is computed.
        load: load on the platform at its origin in base axes, (6,) [N m, N] or a
            dictionary such as ``{"fz": -50}``; None for no load.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        stiffness: state in which the platform stiffness is computed, ``"contact"`` or
            ``"exact"``; empty to omit the stiffness.
        precision: [rad, m] required difference between the bounds on the largest pose
            errors in the worst clearance model; inf if they are not needed.
        contact_length: [m] ratio of random moments to random forces in the contact
            model; None for the length of the longest body.
    """

    posture: Posture
    sources: Sources
    seed: int = 1
    clearance: str = "worst"
    margins: bool = True
    stress: bool = True
    load: Load | None = None
    gravity: tuple[float, ...] | None = None
    stiffness: str = ""
    precision: tuple[float, float] = PRECISION
    contact_length: float | None = None

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        if self.clearance not in CLEARANCE_MODELS:
            raise ValueError(
                f"clearance is {self.clearance!r}, expected one of "
                f"{tuple(CLEARANCE_MODELS)}"
            )
        if self.contact_length is not None and not 0 < self.contact_length < np.inf:
            raise ValueError(f"contact length is {self.contact_length}, expected > 0 m")

    @property
    def clearance_model(self) -> str:
        """Deprecated name of ``clearance``."""
        warn_renamed("Experiment.clearance_model", "Experiment.clearance")
        return self.clearance

    @cached_property
    def wrench(self) -> tuple[float, ...] | None:
        """Load on the platform, (6,) [N m, N]; None if there is no load."""
        return None if self.load is None else tuple(one_load(self.load).tolist())

    @property
    def used_contact_length(self) -> float | None:
        """Contact length [m]; None unless the clearance model is "contact"."""
        if self.clearance != "contact":
            return None
        return self.contact_length or contact_length_of(self.posture.robot)

    @cached_property
    def energies(self) -> LinearResponse:
        """Linear response of the posture for problem (22), the minimum energy.

        Raises:
            BadInput: the load acts along a motion without stiffness.
        """
        try:
            return linear_response(self.posture, self.wrench, self.gravity)
        except FreeMotion as error:
            raise BadInput(f"{self.posture.robot.name}: {error}") from None

    @cached_property
    def zones(self) -> dict[str, PostureMargins]:
        """Problem (21) at the posture for each margin, by name of the margin."""
        if not self.margins:
            return {}
        return {k: prepare_margins(self.posture, r) for k, r in MARGINS.items()}

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Frame names of the links whose stress is computed."""
        if not self.stress:
            return ()
        return tuple(link.frame for link in stressed_links(self.posture.robot))

    @property
    def stress_errors(self) -> list[float]:
        """Estimated relative discretisation error of each link's stress [-]."""
        if not self.stress:
            return []
        return [x.relative_error for x in stressed_links(self.posture.robot)]

    @cached_property
    def record_type(self) -> np.dtype:
        """Data type of a record, which contains the results of one draw."""
        shapes: dict[str, tuple[int, ...]] = {
            "energy": (), "duality_gap": (), "platform_screw": (6,), "rotation": (),
            "translation": (), "force": (), "moment": (), "stress": (len(self.links),),
        }  # fmt: skip
        if self.clearance == "worst":
            shapes |= {f"{name}_lower": () for name in POSE_ERRORS}
        shapes |= dict.fromkeys(self.zones, ())
        if self.stiffness:
            shapes |= {"stiffness": (6,), "free_motion": (6, 6)}
        fields = [(name, "<f8", shape) for name, shape in shapes.items()]
        flags = ["clearance_mixed"] if self.clearance == "uniform" else []
        return np.dtype([*fields, *((name, "u1") for name in [*flags, "status"])])

    def check_limits(self, limits: Iterable[str]) -> None:
        """Raise an error for limits on quantities that are not computed.

        Raises:
            BadInput: there is a limit on a margin or a stress that is not computed.
        """
        for name in limits:
            if name.startswith("margin") and not self.margins:
                raise BadInput(f"limit {name}: the margins are not computed")
            if name == "stress" and not self.links:
                raise BadInput(
                    f"limit stress: found no link of {self.posture.robot.name} with a "
                    "known shape, so no stress is computed"
                )

    def solve(self, first: int, count: int) -> NDArray:
        """Return the results of draws ``first`` to ``first + count - 1`` as records."""
        values = self.sources.draw(first, count, self.seed)
        return self.evaluate(values, range(first, first + count))

    def evaluate(self, values: NDArray, draws: Sequence[int] | NDArray) -> NDArray:
        """Return the results for given errors as records.

        Args:
            values: (k, m) [rad or m] errors.
            draws: (k,) indices of the draws, which select the random numbers of the
                clearance positions.

        Returns:
            Records of type :attr:`record_type`, (k,). A draw without a solution has NaN
            and status 1. In the worst clearance model, rotation and translation are
            upper bounds on the largest errors, and the platform screw is the
            minimum-energy solution (22).
        """
        if not isinstance(self.sources, CalloutSources) or not self.sources.fits:
            parts = self._bolted(values, np.asarray(draws))
        else:
            parts = []
            for own, draw in zip(values, np.asarray(draws).tolist(), strict=True):
                # The clearances of fits differ between draws.
                robot = self.sources.with_clearances(own)
                one = replace(self, posture=replace(self.posture, robot=robot))
                parts += one._bolted(own[None], np.array([draw]))
        rows, wrenches, at_tips = (
            np.concatenate(arrays) for arrays in zip(*parts, strict=True)
        )
        if self.links:
            rows["stress"] = peak_stresses(self.posture.robot, wrenches, at_tips)
        return rows

    def _bolted(
        self, values: NDArray, draws: NDArray
    ) -> list[tuple[NDArray, NDArray, NDArray]]:
        """Return the results of draws in blocks; NaN if a joint cannot be bolted."""
        try:
            return [self._without_stress(values, draws)]
        except CannotBolt:
            if len(values) > 1:
                halves = zip(
                    *(np.array_split(a, 2) for a in (values, draws)), strict=True
                )
                return [part for half in halves for part in self._bolted(*half)]
        rows = np.zeros(1, dtype=self.record_type)
        for name in set(self.record_type.names or ()) - {"clearance_mixed", "status"}:
            rows[name] = np.nan
        rows["status"] = 1
        wrenches = np.full((1, len(self.posture.robot.frames), 6), np.nan)
        return [(rows, wrenches, wrenches)]

    def _without_stress(
        self, values: NDArray, draws: Sequence[int] | NDArray
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Return results without stress, link wrenches, and weights at link tips."""
        robot = self.posture.robot
        bolts = bolt_generators(robot, self.seed, draws)
        errors = bolted_errors(robot, self.sources.errors(values), bolts)
        solved = self.energies.solve(errors)
        rows = np.zeros(len(values), dtype=self.record_type)
        rows["energy"] = solved.energy
        rows["duality_gap"] = solved.duality_gap()
        rows["status"] = ~np.isfinite(solved.energy)
        screws = solved.platform_screw
        if self.clearance == "worst":
            bounds, _ = bound_worst_errors(solved, self.precision)
            for i, name in enumerate(POSE_ERRORS):
                rows[f"{name}_lower"], rows[name] = bounds[:, i].T
        else:
            # Create generators only if needed, because this is slow.
            numbers = np.asarray(draws).tolist() if self.clearance != "least" else []
            rngs = [draw_generator(self.seed, d, CLEARANCE_STREAM) for d in numbers]
            screws, mixed = position_clearances(
                self.energies, solved, self.clearance, rngs, self.contact_length
            )
            for i, name in enumerate(POSE_ERRORS):
                rows[name] = np.linalg.norm(screws[:, 3 * i : 3 * i + 3], axis=1)
            if self.clearance == "uniform":
                rows["clearance_mixed"] = mixed
        rows["platform_screw"] = screws
        at_tips = solved.frame_loads.at_tips
        wrenches = without_rounding(solved.wrenches)
        for name, part in (("moment", slice(0, 3)), ("force", slice(3, 6))):
            through = wrenches[..., part] - at_tips[..., part]
            sizes = np.sqrt((through**2).sum(axis=-1))
            rows[name] = sizes.max(axis=1)
        for name, zone in self.zones.items():
            rows[name] = zone.solve(errors).margin
        if self.stiffness:
            rows["stiffness"], rows["free_motion"] = draw_stiffnesses(
                self.posture, errors, self.stiffness, self.wrench, self.gravity
            )
        return rows, wrenches, np.broadcast_to(at_tips, wrenches.shape)


def precision_for(
    limits: Mapping[str, float], share: float = _PRECISION
) -> tuple[float, float]:
    """Return the precision of pose errors that suffices to check limits.

    Args:
        limits: limits by quantity.
        share: required precision, relative to a limit.

    Returns:
        [rad, m] precision for an :class:`Experiment`.
    """
    rotation, translation = (
        min(usual, share * limits.get(name, np.inf))
        for name, usual in zip(POSE_ERRORS, PRECISION, strict=True)
    )
    return rotation, translation
