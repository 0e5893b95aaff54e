"""A campaign looked at before any diagnosis: what is there, and what it can tell."""

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign import LOAD, READING, Campaign
from validation.design_remarks import CAREFUL, LOST, Remark, correlation, remarks_on
from validation.design_signatures import (
    DesignSignatures,
    changes_between_repeats,
    design_signatures,
)
from validation.measuring_order import Revisits, revisits
from validation.repeats import RepeatNoise, repeat_noise
from validation.separability import SEEN, Separability, compare_signatures


@dataclass(frozen=True, eq=False)
class Inspection:
    """What a campaign's design can and cannot tell.

    Attributes:
        campaign: of R rows.
        repeats: how rows of the same configuration and load lie in the session.
        visits: how rows of the same configuration lie in it.
        noise: as the repeats show it, None if nothing was measured twice.
        signatures: of the library's effects.
        separability: their angles.
        remarks: sentences, those on what is lost first.
    """

    campaign: Campaign
    repeats: Revisits
    visits: Revisits
    noise: RepeatNoise | None
    signatures: DesignSignatures
    separability: Separability
    remarks: tuple[Remark, ...]

    def table(self) -> dict:
        """Everything, in plain values for JSON."""
        c = self.campaign
        return {
            "campaign": c.name,
            "robot": c.robot.name,
            "rows": len(c),
            "commanded": c.commanded,
            "registration": c.registration,
            "reference_point": c.reference_point,
            "configurations": _count_table(c.configuration) | asdict(self.visits)
            | {"order": self.visits.order},
            "loads": _load_table(c),
            "readings": _reading_table(c),
            "covariates": _covariate_table(c),
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
        }  # fmt: skip

    def _effect_table(self) -> dict:
        """Each effect: how much of it would show."""
        found: dict[str, dict] = {
            name: {"testable": False, "why": why}
            for name, why in self.signatures.untestable.items()
        }
        s = self.separability
        for i, name in enumerate(s.names):
            found[name] = {
                "testable": bool(s.traced[i]),
                "shows": bool(s.visible[i]),
                "shows_at": self._shows_at(i) if s.traced[i] else None,
                "strength": s.strength[i],
                "left_by_registration": s.left[i],
                "unknowns": s.unknowns[i],
                "rank": s.rank[i],
            }
        return found

    def _shows_at(self, i: int) -> float:
        """Factor on plausible sizes at which an effect would stand out of the noise."""
        return SEEN / (self.separability.strength[i] * self.separability.left[i])

    def text(self) -> str:
        """The same for people."""
        c = self.campaign
        kinds = _count_table(c.configuration)
        lines = [
            f"{c.name}: {len(c)} rows of {c.robot.name}, {kinds['count']} "
            f"configurations commanded by {c.commanded}, registration {c.registration}",
            *_reading_lines(c),
            *_load_lines(c),
            *_covariate_lines(c),
            f"repeats: {self.repeats.sets} sets of {self.repeats.rows} rows, "
            f"{self.repeats.order}",
            *_noise_lines(c, self.noise),
            "",
            *self._separability_lines(),
        ]
        heads = {LOST: "What this campaign cannot tell:", CAREFUL: "Be careful:"}
        for weight, head in heads.items():
            found = [f"  {r.text}" for r in self.remarks if r.weight == weight]
            lines += ["", head, *found] if found else []
        return "\n".join(lines)

    def _separability_lines(self) -> list[str]:
        """Which effects would show, and which look alike."""
        s = self.separability
        lines = ["Effects, at plausible sizes, in this design:"]
        shown = [n for n, seen in zip(s.names, s.visible, strict=True) if seen]
        lines.append(f"  would show: {', '.join(shown) or 'none'}")
        small = s.traced & ~s.visible
        weak = [
            f"{n} (at {self._shows_at(i):.2g} times that size)"
            for i, n in enumerate(s.names)
            if small[i]
        ]
        if weak:
            lines.append(f"  would show only if larger: {', '.join(weak)}")
        none = [n for n, traced in zip(s.names, s.traced, strict=True) if not traced]
        if none:
            lines.append(f"  leaves no trace: {', '.join(none)}")
        for name, why in self.signatures.untestable.items():
            lines.append(f"  not testable: {name}: {why}")
        for group in s.classes():
            lines.append(f"  cannot be told apart: {', '.join(group)}")
        for a, b in s.imitated():
            lines.append(f"  whatever {a} does, {b} can do as well")
        by_first: dict[str, list[str]] = {}
        for a, b in s.overlapping():
            by_first.setdefault(a, []).append(b)
        for a, others in by_first.items():
            lines.append(f"  some of what {a} does looks like: {', '.join(others)}")
        return lines


def inspect_campaign(
    campaign: Campaign, progress: Callable[[int, int], None] = lambda done, total: None
) -> Inspection:
    """Look at a campaign's design.

    Args:
        campaign: as read.
        progress: called with effects done and their number.

    Returns:
        What it can and cannot tell.
    """
    signatures = design_signatures(campaign, progress)
    noise = repeat_noise(campaign, changes_between_repeats(campaign, signatures))
    repeats = revisits(campaign, campaign.repeat)
    visits = revisits(campaign, campaign.configuration)
    return Inspection(
        campaign=campaign,
        repeats=repeats,
        visits=visits,
        noise=noise,
        signatures=signatures,
        separability=compare_signatures(signatures.columns, signatures.nuisance),
        remarks=tuple(remarks_on(campaign, repeats, visits, noise)),
    )


def _count_table(kinds: NDArray) -> dict:
    """How many rows each kind has."""
    _, rows = np.unique(kinds, return_counts=True)
    return {"count": len(rows), "rows_each": [rows.min(), np.median(rows), rows.max()]}


def _load_table(c: Campaign) -> dict:
    """Levels, sizes and directions of the load."""
    force = np.linalg.norm(c.loads[:, 3:], axis=1)
    moment = np.linalg.norm(c.loads[:, :3], axis=1)
    pairs = np.unique(np.column_stack([c.configuration, c.repeat]), axis=0)
    return {
        "levels": len(np.unique(c.loads.round(9), axis=0)),
        "unloaded_rows": int((~c.loads.any(axis=1)).sum()),
        "force": [force.min(), force.max()],
        "moment": [moment.min(), moment.max()],
        "components": [n for n, w in zip(LOAD, c.loads.T, strict=True) if w.any()],
        "configurations_under_several": int((np.bincount(pairs[:, 0]) > 1).sum()),
    }


def _reading_table(c: Campaign) -> dict:
    """Each component: cells, size, sigma."""
    found = {}
    for k, name in enumerate(READING):
        cells = c.cells[:, k]
        entry: dict = {"measured": int(cells.sum()), "missing": int((~cells).sum())}
        if cells.any():
            values, sigma = c.measured[cells, k], c.sigma[cells, k]
            entry |= {
                "rms": np.sqrt(np.mean(values**2)),
                "largest": np.abs(values).max(),
                "sigma": [sigma.min(), sigma.max()],
            }
        found[name] = entry
    return found


def _covariate_table(c: Campaign) -> dict:
    """Each covariate: range, levels, and with what it varies."""
    return {
        name: {
            "range": [x.min(), x.max()],
            "std": x.std(),
            "levels": len(np.unique(x)),
            "correlation": {
                other: correlation(x, y)
                for other, y in c.covariates.items()
                if other != name
            },
        }
        for name, x in c.covariates.items()
    }


def _noise_table(c: Campaign, noise: RepeatNoise | None) -> dict | None:
    """Noise from repeats against the stated one, suspects by their labels."""
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


def _reading_lines(c: Campaign) -> list[str]:
    """One line for each component measured."""
    lines = []
    for name, entry in _reading_table(c).items():
        if entry["measured"]:
            unit = "rad" if name[0] == "r" else "m"
            low, high = entry["sigma"]
            sigma = f"{low:.3g}" if low == high else f"{low:.3g} ... {high:.3g}"
            missing = f", {entry['missing']} missing" if entry["missing"] else ""
            lines.append(
                f"  {name}: rms {entry['rms']:.3g} {unit}, sigma {sigma}{missing}"
            )
    return lines


def _load_lines(c: Campaign) -> list[str]:
    """Levels and sizes of the load."""
    t = _load_table(c)
    return [
        f"load: {t['levels']} levels, up to {t['force'][1]:.4g} N and "
        f"{t['moment'][1]:.4g} N m, {t['unloaded_rows']} rows without"
    ]


def _covariate_lines(c: Campaign) -> list[str]:
    """Range of each covariate."""
    return [
        f"{name}: {t['range'][0]:.4g} ... {t['range'][1]:.4g}, {t['levels']} levels"
        for name, t in _covariate_table(c).items()
    ]


def _noise_lines(c: Campaign, noise: RepeatNoise | None) -> list[str]:
    """Noise from repeats over the stated one, by component, and suspects."""
    if noise is None:
        return []
    low, high = noise.interval
    lines = [
        f"noise from repeats: {noise.ratio:.2f} ({low:.2f} ... {high:.2f}, 90 %) times "
        f"the stated sigma, {noise.degrees} degrees of freedom; "
        f"{noise.plain:.2f} with slow changes left in"
    ]
    for k, name in enumerate(READING):
        if np.isfinite(noise.component[k]):
            a, b = noise.component_interval[k]
            unit = "rad" if k < 3 else "m"
            lines.append(
                f"  {name}: {noise.component[k]:.3g} ({a:.2g} ... {b:.2g}) {unit}, "
                f"{noise.component_degrees[k]:.0f} degrees of freedom"
            )
    for s in noise.suspects:
        who = " or ".join(c.ids[i] for i in s.rows)
        lines.append(f"  suspect: {who}, {s.component}, {abs(s.size):.1f} deviations")
    return lines
