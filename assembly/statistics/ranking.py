"""Ranks of error contributions to a variance, and names of errors in reports."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.screws import SCREW

_IN_SENTENCE = 3  # largest number of errors in a sentence

NOT_DISTINGUISHED = (
    "rank: range of possible ranks; the order of errors with overlapping ranges is "
    "unknown"
)


def possible_ranks(shares: Mapping[str, NDArray]) -> dict[str, tuple[int, int]]:
    """Return the best and the worst possible rank of each contribution.

    Args:
        shares: estimate and confidence bounds (lower, upper) of each contribution, by
            name.

    Returns:
        Best and worst rank by name. Two contributions have a definite order only if
        their confidence intervals do not overlap. Contributions of NaN are omitted.
    """
    known = {name: v for name, v in shares.items() if np.isfinite(v).all()}
    lower, upper = np.array([v[1:] for v in known.values()]).reshape(-1, 2).T
    return {
        name: (
            1 + int((lower > v[2]).sum()),
            len(known) - int((upper < v[1]).sum()),
        )
        for name, v in known.items()
    }


def rank_text(rank: Sequence[int] | None) -> str:
    """Format a range of ranks as text, such as ``2-4``."""
    if rank is None:
        return ""
    first, last = rank
    return f"{first}" if first == last else f"{first}-{last}"


def ranked(summary: Mapping[str, Any], key: str) -> list[tuple[str, list[float]]]:
    """Return the total Sobol indices of a quantity in descending order.

    Args:
        summary: result of :func:`forcefit.assembly.statistics.summary.summarise`.
        key: name of the quantity.

    Returns:
        Names of errors with (value, lower, upper); empty if there are no indices.
    """
    one = summary.get("importance", {}).get("quantities", {}).get(key, {})
    if "reason" in one or "total_index" not in one:
        return []
    shares = [(name, list(map(float, v))) for name, v in one["total_index"].items()]
    known = [(name, v) for name, v in shares if np.isfinite(v[0]) and v[0] > 1e-6]
    return sorted(known, key=lambda item: -item[1][0])


def shares_sentence(
    shares: Sequence[tuple[str, Sequence[float]]], quantity: str
) -> str:
    """Format the largest contributions to a variance as a sentence.

    Args:
        shares: names with (value, lower, upper), in descending order.
        quantity: name of the quantity.

    Returns:
        A sentence such as ``"position of bore 2 on link_a: 31 % of the variance of the
        translation (27 to 36 %); .."``. Values are clipped to the range from 0 to 100
        %.
    """
    parts = []
    for name, share in shares[:_IN_SENTENCE]:
        value, low, high = (100 * min(max(x, 0.0), 1.0) for x in share)
        parts.append(f"{name}: {value:.0f} % ({low:.0f} to {high:.0f} %)")
    parts[0] = parts[0].replace(" % (", f" % of the variance of the {quantity} (", 1)
    return "; ".join(parts)


def leaders(ranks: Mapping[str, Sequence[int]]) -> list[str]:
    """Return the names of all errors whose contribution may be the largest."""
    return [name for name, (first, _) in ranks.items() if first == 1]


def named_together(names: Iterable[str], among: Iterable[str]) -> list[str]:
    """Merge names that are equal in all legs.

    Args:
        names: names of errors, such as ``leg1.hinge.RX``.
        among: names of all errors of the robot.

    Returns:
        The names in the same order. Names that occur for every leg are replaced by one
        name, such as ``hinge.RX of all legs``.
    """
    names = list(names)
    of_kind: dict[str, list[str]] = {}
    for name in among:
        of_kind.setdefault(kind_of(name), []).append(name)
    together = []
    for name in names:
        same = of_kind.get(kind_of(name), [name])
        whole = len(same) > 1 and set(same) <= set(names)
        together.append(f"{kind_of(name)} of all legs" if whole else name)
    return list(dict.fromkeys(together))


def group_of(label: str, by: str) -> str:
    """Return the group of an error ``leg1.hinge.RX`` by source, frame or kind."""
    return {
        "source": label, "frame": label.rpartition(".")[0], "kind": kind_of(label)
    }[by]  # fmt: skip


def kind_of(name: str) -> str:
    """Return the name of a frame or an error without the leg name."""
    frame, dot, component = name.rpartition(".")
    if component not in SCREW:
        frame, dot, component = name, "", ""
    leg, in_leg, rest = frame.partition(".")
    return f"{rest if in_leg else leg}{dot}{component}"
