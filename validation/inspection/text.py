"""Format an inspection of a campaign as text."""

import numpy as np

from forcefit.validation.campaign.campaign import READING, Campaign
from forcefit.validation.diagnosis.sentence import open_text
from forcefit.validation.inspection.counts import (
    covariate_counts,
    load_counts,
    reading_counts,
    row_counts,
)
from forcefit.validation.inspection.inspection import Inspection
from forcefit.validation.inspection.remark import CAREFUL, LOST
from forcefit.validation.inspection.repeats import RepeatNoise


def inspection_text(inspection: Inspection) -> str:
    """Format an inspection as text."""
    c = inspection.campaign
    kinds = row_counts(c.configuration)
    lines = [
        f"{c.name}: {len(c)} rows of {c.robot.name}, {kinds['count']} "
        f"configurations commanded by {c.commanded}, registration {c.registration}",
        *_reading_lines(c),
        *_load_lines(c),
        *_covariate_lines(c),
        f"repeats: {inspection.repeats.sets} sets of {inspection.repeats.rows} rows, "
        f"{inspection.repeats.order}",
        *_noise_lines(c, inspection.noise),
        *([open_text(inspection.open)] if inspection.open.any() else []),
        "",
        *_separability_lines(inspection),
    ]
    heads = {LOST: "This campaign cannot determine:", CAREFUL: "Warnings:"}
    for weight, head in heads.items():
        remarks = [f"  {r.text}" for r in inspection.remarks if r.weight == weight]
        lines += ["", head, *remarks] if remarks else []
    return "\n".join(lines)


def _separability_lines(inspection: Inspection) -> list[str]:
    """Return lines about detectable effects and indistinguishable effects."""
    s = inspection.separability
    lines = ["Effects of plausible size in this design:"]
    shown = [n for n, seen in zip(s.names, s.visible, strict=True) if seen]
    lines.append(f"  detectable: {', '.join(shown) or 'none'}")
    small = s.traced & ~s.visible
    weak = [
        f"{n} (from {s.shows_at[i]:.2g} times the plausible size)"
        for i, n in enumerate(s.names)
        if small[i]
    ]
    if weak:
        lines.append(f"  detectable only if larger: {', '.join(weak)}")
    none = [n for n, traced in zip(s.names, s.traced, strict=True) if not traced]
    if none:
        lines.append(f"  without effect on the readings: {', '.join(none)}")
    for name, why in inspection.signatures.untestable.items():
        lines.append(f"  not testable: {name}: {why}")
    for group in s.classes():
        lines.append(f"  cannot be distinguished: {', '.join(group)}")
    for a, b in s.imitated():
        lines.append(f"  {b} can reproduce every effect of {a}")
    by_first: dict[str, list[str]] = {}
    for a, b in s.overlapping():
        by_first.setdefault(a, []).append(b)
    for a, others in by_first.items():
        lines.append(f"  {a} is partly reproduced by: {', '.join(others)}")
    return lines


def _reading_lines(c: Campaign) -> list[str]:
    """Return one line for each measured component."""
    lines = []
    for name, entry in reading_counts(c).items():
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
    """Return one line about the number of loads and their magnitudes."""
    t = load_counts(c)
    return [
        f"load: {t['levels']} levels, up to {t['force'][1]:.4g} N and "
        f"{t['moment'][1]:.4g} N m, {t['unloaded_rows']} rows without load"
    ]


def _covariate_lines(c: Campaign) -> list[str]:
    """Return one line with the range of each covariate."""
    return [
        f"{name}: {t['range'][0]:.4g} ... {t['range'][1]:.4g}, {t['levels']} levels"
        for name, t in covariate_counts(c).items()
    ]


def _noise_lines(c: Campaign, noise: RepeatNoise | None) -> list[str]:
    """Return lines about the noise and about suspect readings."""
    if noise is None:
        return []
    low, high = noise.interval
    lines = [
        f"noise from repeats: {noise.ratio:.2f} ({low:.2f} ... {high:.2f}, 90 %) times "
        f"the stated sigma, {noise.degrees} degrees of freedom; "
        f"{noise.plain:.2f} times including slow changes"
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
        lines.append(
            f"  suspect reading: {who}, {s.component}, {abs(s.size):.1f} standard "
            "deviations"
        )
    return lines
