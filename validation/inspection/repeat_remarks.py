"""Write remarks about the noise estimated from the repeats of a campaign."""

import numpy as np
from scipy.stats import chi2

from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.lack_of_fit import UNLIKELY
from forcefit.validation.inspection.measuring_order import Revisits, session_clock
from forcefit.validation.inspection.remark import CAREFUL, FINE, LOST, Remark
from forcefit.validation.inspection.repeats import MOST, RepeatNoise

_FEW = 20  # degrees of freedom below which the estimated noise is uncertain
_SEVERAL = 4  # smallest number of suspect readings that cause a remark


def on_repeats(
    campaign: Campaign, repeats: Revisits, noise: RepeatNoise | None
) -> list[Remark]:
    """Return remarks about the noise estimated from the repeats.

    Args:
        campaign: campaign of R rows.
        repeats: measuring order of the repeats.
        noise: noise computed from the repeats, None without repeats.
    """
    if noise is None:
        text = (
            "There are no repeated measurements. The noise cannot be checked, and the "
            "goodness of fit is tested only with the stated sigma."
        )
        return [Remark("repeats", LOST, text)]
    remarks = []
    if repeats.order == "back to back":
        text = (
            "Repeats were measured consecutively, so they contain no slow drift. The "
            "noise from repeats is too small, and a correct model may be rejected."
        )
        remarks.append(Remark("repeats", CAREFUL, text))
    elif repeats.order == "mixed":
        text = (
            "Only some repeats are spread over the session, so they contain only part "
            "of the drift."
        )
        remarks.append(Remark("repeats", CAREFUL, text))
    elif repeats.order == "interleaved":
        remarks.append(Remark("repeats", FINE, "Repeats are spread over the session."))
    if noise.degrees < _FEW:
        text = f"There are few repeats ({noise.degrees} degrees of freedom)."
        remarks.append(Remark("repeats", CAREFUL, text))
    low, high = noise.interval
    size = f"{noise.ratio:.2f} times the stated sigma ({low:.2f} ... {high:.2f})"
    squares = noise.degrees * noise.ratio**2
    if chi2.sf(squares, noise.degrees) < UNLIKELY:
        text = (
            f"The scatter of repeats is {size}. The stated sigma is too small, or a "
            "quantity other than time, temperature or approach changes between repeats."
        )
        remarks.append(Remark("repeats", CAREFUL, text))
    elif chi2.cdf(squares, noise.degrees) < UNLIKELY:
        text = (
            f"The scatter of repeats is only {size}. The stated sigma is too large, or "
            "repeats have a common error."
        )
        remarks.append(Remark("repeats", CAREFUL, text))
    for name, chance in noise.taken_out.items():
        if chance < UNLIKELY:
            text = f"Changes of repeats with {name} exceed the noise."
            remarks.append(Remark("repeats", CAREFUL, text))
    return remarks + _on_suspects(campaign, noise)


def _on_suspects(campaign: Campaign, noise: RepeatNoise) -> list[Remark]:
    """Return remarks about readings that deviate too much from their repeats."""
    suspects = noise.suspects
    if len(suspects) < _SEVERAL:
        return []
    order = np.argsort(np.argsort(session_clock(campaign), kind="stable"))
    rows = sorted({int(order[i]) for s in suspects for i in s.rows})
    if 2 * np.count_nonzero(np.diff(rows) == 1) >= len(rows) - 1:
        text = (
            "Readings that differ strongly from their repeats are consecutive in time. "
            "The cause is probably a sudden change instead of isolated blunders."
        )
        return [Remark("suspects", CAREFUL, text)]
    if len(suspects) == MOST:
        text = (
            f"At least {MOST} readings differ strongly from their repeats. The scatter "
            "is not normally distributed."
        )
        return [Remark("suspects", CAREFUL, text)]
    return []
