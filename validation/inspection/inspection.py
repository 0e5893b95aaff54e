"""Inspect the content of a campaign and its detectable effects."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.tables import frame_table, labelled
from forcefit.results.display import html_table, short_repr
from forcefit.results.quantities import flag, number, text
from forcefit.validation.campaign.campaign import READING, Campaign
from forcefit.validation.diagnosis.separability import Separability, compare_signatures
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.inspection.counts import (
    covariate_counts,
    load_counts,
    reading_counts,
    row_counts,
)
from forcefit.validation.inspection.design_remarks import remarks_on
from forcefit.validation.inspection.design_signatures import (
    DesignSignatures,
    changes_between_repeats,
    design_signatures,
)
from forcefit.validation.inspection.measuring_order import Revisits, revisits
from forcefit.validation.inspection.remark import CAREFUL, LOST, Remark
from forcefit.validation.inspection.repeats import RepeatNoise, repeat_noise

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, eq=False)
class Inspection:
    """Result of the inspection of a campaign.

    Attributes:
        campaign: campaign of R rows.
        repeats: measuring order of rows with the same configuration and load.
        visits: measuring order of rows with the same configuration.
        noise: noise computed from the repeats, None if no row was measured twice.
        signatures: signatures of the library effects.
        separability: comparison of the signatures.
        remarks: remarks about the design, most serious first.
        open: (R,) mask of rows in which the pose is undetermined because of clearances.
    """

    campaign: Campaign
    repeats: Revisits
    visits: Revisits
    noise: RepeatNoise | None
    signatures: DesignSignatures
    separability: Separability
    remarks: tuple[Remark, ...]
    open: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Convert the detectability of each effect to a data set."""
        s, absent = self.separability, self.signatures.untestable
        no, unknown = [False] * len(absent), [np.nan] * len(absent)
        size = number("norm of the change of the readings, divided by sigma")
        rank = number("number of unknowns that the design distinguishes")
        values = {
            "testable": (flag("can be tested"), [*s.traced, *no]),
            "shows": (flag("detectable at plausible size"), [*s.visible, *no]),
            "strength": (size, [*s.strength, *unknown]),
            "rank": (rank, [*s.rank, *unknown]),
            "reason": (text("reason"), [*[""] * len(s.names), *absent.values()]),
        }
        data = labelled(values, "effect", [*s.names, *absent])
        return data.assign_attrs(campaign=self.campaign.name)

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert to a pandas table with one row per effect."""
        return frame_table(self.to_xarray(), "effect")

    def table(self) -> dict:
        """Convert to plain values for JSON."""
        c = self.campaign
        return {
            "campaign": c.name,
            "robot": c.robot.name,
            "rows": len(c),
            "commanded": c.commanded,
            "registration": c.registration,
            "reference_point": c.reference_point,
            "configurations": row_counts(c.configuration) | asdict(self.visits)
            | {"order": self.visits.order},
            "loads": load_counts(c),
            "readings": reading_counts(c),
            "covariates": covariate_counts(c),
            "repeats": asdict(self.repeats) | {"order": self.repeats.order},
            "noise": _noise_table(c, self.noise),
            "effects": self._effect_table(),
            "inseparable": self.separability.classes(),
            "imitated": self.separability.imitated(),
            "overlapping": self.separability.overlapping(),
            "cosines": {
                "effects": self.separability.names,
                "smallest_angle": self.separability.cosine,
                "shared": self.separability.shared,
            },
            "remarks": [asdict(r) for r in self.remarks],
            "open": [i for i, free in zip(c.ids, self.open, strict=True) if free],
        }  # fmt: skip

    def _effect_table(self) -> dict:
        """Convert the detectability of each effect to plain values."""
        table: dict[str, dict] = {
            name: {"testable": False, "why": why}
            for name, why in self.signatures.untestable.items()
        }
        s = self.separability
        for i, name in enumerate(s.names):
            table[name] = {
                "testable": bool(s.traced[i]),
                "shows": bool(s.visible[i]),
                "shows_at": s.shows_at[i],
                "strength": s.strength[i],
                "left_by_registration": s.left[i],
                "unknowns": s.unknowns[i],
                "rank": s.rank[i],
            }
        return table


def inspect_campaign(
    campaign: Campaign, progress: Callable[[int, int], None] = lambda done, total: None
) -> Inspection:
    """Inspect the design of a campaign.

    Args:
        campaign: campaign to inspect.
        progress: function called with the number of finished effects and the total
            number.

    Returns:
        The inspection.
    """
    signatures = design_signatures(campaign, progress)
    noise = repeat_noise(campaign, changes_between_repeats(campaign, signatures))
    repeats = revisits(campaign, campaign.repeat)
    visits = revisits(campaign, campaign.configuration)
    remarks = remarks_on(campaign, repeats, visits, noise)
    remarks += [Remark("robot", CAREFUL, text) for text in campaign.robot.remarks]
    if signatures.unregistered:
        text = f"The registration cannot be found. {signatures.unregistered}"
        remarks.insert(0, Remark("registration", LOST, text))
    return Inspection(
        campaign=campaign,
        repeats=repeats,
        visits=visits,
        noise=noise,
        signatures=signatures,
        separability=compare_signatures(signatures.columns, signatures.nuisance),
        remarks=tuple(remarks),
        open=predict(conditions_of(campaign)).undetermined,
    )


def _noise_table(c: Campaign, noise: RepeatNoise | None) -> dict | None:
    """Convert the noise estimated from repeats to plain values."""
    if noise is None:
        return None
    return {
        "ratio": noise.ratio,
        "degrees": noise.degrees,
        "interval": noise.interval,
        "ratio_with_slow_changes": noise.plain,
        "chance_without_change": noise.taken_out,
        "component": dict(zip(READING, noise.component.tolist(), strict=True)),
        "component_degrees": dict(
            zip(READING, noise.component_degrees.tolist(), strict=True)
        ),
        "component_interval": dict(
            zip(READING, noise.component_interval.tolist(), strict=True)
        ),
        "suspects": [
            asdict(s) | {"rows": [c.ids[i] for i in s.rows]} for s in noise.suspects
        ],
    }
