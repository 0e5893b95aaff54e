"""What is drawn at a posture, and what is asked of each draw."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.batch.many_draws import OnePosture, prepare_energies
from assembly.batch.many_margins import PostureMargins, prepare_margins
from assembly.kinematics.posture import Posture
from assembly.linear.reduction import FreeMotion
from assembly.linear.zone import MARGIN_READINGS
from assembly.model.error_distributions import ErrorSources, draw_generator
from assembly.model.link_stress import peak_stresses, stressed_links
from assembly.statistics.play import PLAY, PLAY_STREAM, settle_play
from assembly.statistics.quantities import POSE_ERRORS
from assembly.statistics.worst_play import PRECISION, bound_play
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.table import BadInput

_SHARP = 1e-3  # of a limit: how far apart the bounds may be that it judges


@dataclass(frozen=True, eq=False)
class Experiment:
    """What is drawn, and what is asked of each draw.

    Attributes:
        posture: where the robot stands; drawn errors take the place of its own.
        sources: of the errors.
        seed: of all draws.
        play: one of :data:`assembly.statistics.play.PLAY`, where play sits.
        margins: whether the zone margins are asked for.
        stress: whether the links' stress is.
        load: (6,) [N m, N] on the platform at its origin, base axes; none if absent.
        gravity: (3,) [m/s^2] base axes; none if absent.
        precision: [rad, m] of the largest pose errors with the worst play: upper minus
            lower bound; inf for one that is not asked for.
    """

    posture: Posture
    sources: ErrorSources
    seed: int = 1
    play: str = "worst"
    margins: bool = True
    stress: bool = True
    load: tuple[float, ...] | None = None
    gravity: tuple[float, ...] | None = None
    precision: tuple[float, float] = PRECISION

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        if self.play not in PLAY:
            raise ValueError(f"play is {self.play!r}, expected one of {tuple(PLAY)}")

    @cached_property
    def energies(self) -> OnePosture:
        """The posture made ready for (22).

        Raises:
            BadInput: the load drives a motion that nothing resists.
        """
        try:
            return prepare_energies(self.posture, self.load, self.gravity)
        except FreeMotion as error:
            raise BadInput(f"{self.posture.robot.name}: {error}") from None

    @cached_property
    def zones(self) -> dict[str, PostureMargins]:
        """And for (21), by quantity."""
        if not self.margins:
            return {}
        return {k: prepare_margins(self.posture, r) for k, r in MARGIN_READINGS.items()}

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Frames of the links whose stress is known and asked for."""
        if not self.stress:
            return ()
        return tuple(link.frame for link in stressed_links(self.posture.robot))

    @cached_property
    def record_type(self) -> np.dtype:
        """A draw as a row of numbers."""
        shapes: dict[str, tuple[int, ...]] = {
            "energy": (), "duality_gap": (), "platform_screw": (6,), "rotation": (),
            "translation": (), "force": (), "moment": (), "stress": (len(self.links),),
        }  # fmt: skip
        if self.play == "worst":
            shapes |= {f"{name}_lower": () for name in POSE_ERRORS}
        shapes |= dict.fromkeys(self.zones, ())
        fields = [(name, "<f8", shape) for name, shape in shapes.items()]
        flags = ["play_mixed"] if self.play == "uniform" else []
        return np.dtype([*fields, *((name, "u1") for name in [*flags, "status"])])

    def check_limits(self, limits: Iterable[str]) -> None:
        """Refuse limits on what is not computed here.

        Raises:
            BadInput: margins were left out, or no link's stress is known.
        """
        for name in limits:
            if name.startswith("margin") and not self.margins:
                raise BadInput(f"limit {name}: the margins were left out")
            if name == "stress" and not self.links:
                raise BadInput(
                    f"limit stress: no link of {self.posture.robot.name} has a shape "
                    "from which its stress follows"
                )

    def solve(self, first: int, count: int) -> NDArray:
        """Rows of the draws ``first`` .. ``first + count - 1``."""
        values = self.sources.draw(first, count, self.seed)
        return self.answer(values, range(first, first + count))

    def answer(self, values: NDArray, draws: Sequence[int] | NDArray) -> NDArray:
        """Rows of given values of the sources.

        Args:
            values: (k, m) [rad or m].
            draws: (k,) numbers of the random numbers that settle the play.

        Returns:
            (k,) of :attr:`record_type`; NaN and status 1 where there is no answer.
            With the worst play, rotation and translation are upper bounds of the
            largest, and the platform's screw is where the solution leaves it.
        """
        errors = self.sources.errors(values)
        found = self.energies.solve(errors)
        rows = np.zeros(len(values), dtype=self.record_type)
        rows["energy"] = found.energy
        rows["duality_gap"] = np.maximum(0.0, found.energy - found.bound)
        rows["status"] = ~np.isfinite(found.energy)
        screws = found.platform_screw
        if self.play == "worst":
            bounds, _ = bound_play(self.energies, found, errors, self.precision)
            for i, name in enumerate(POSE_ERRORS):
                rows[f"{name}_lower"], rows[name] = bounds[:, i].T
        else:
            numbers = np.asarray(draws).tolist()
            rngs = [draw_generator(self.seed, d, PLAY_STREAM) for d in numbers]
            screws, mixed = settle_play(self.energies, found, self.play, rngs)
            for i, name in enumerate(POSE_ERRORS):
                rows[name] = np.linalg.norm(screws[:, 3 * i : 3 * i + 3], axis=1)
            if self.play == "uniform":
                rows["play_mixed"] = mixed
        rows["platform_screw"] = screws
        wrenches = self.energies.wrenches(found.multipliers)
        for name, part in (("moment", slice(0, 3)), ("force", slice(3, 6))):
            sizes = np.sqrt((wrenches[..., part] ** 2).sum(axis=-1))
            rows[name] = sizes.max(axis=1)
        if self.links:
            rows["stress"] = peak_stresses(self.posture.robot, wrenches)
        for name, zone in self.zones.items():
            rows[name] = zone.solve(errors).margin
        return rows


def precision_for(
    limits: Mapping[str, float], share: float = _SHARP
) -> tuple[float, float]:
    """How sharp bounds of pose errors must be for limits to be judged by them.

    Args:
        limits: by quantity.
        share: of a limit.

    Returns:
        [rad, m] for an :class:`Experiment`.
    """
    rotation, translation = (
        min(usual, share * limits.get(name, np.inf))
        for name, usual in zip(POSE_ERRORS, PRECISION, strict=True)
    )
    return rotation, translation
