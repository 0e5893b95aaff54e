"""Possible ranks of variance shares, and merged names for equal errors in all legs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.screws import SCREW

_IN_SENTENCE = 3  # largest number of contributors in a sentence

NOT_DISTINGUISHED = (
    "rank: the ranks that the intervals allow; errors with a rank in common are not "
    "distinguished by these draws"
)


def possible_ranks(shares: Mapping[str, NDArray]) -> dict[str, tuple[int, int]]:
    """Return the best and the worst possible rank of each contributor.

    Args:
        shares: value, lower and upper bound on each share, by name.

    Returns:
        Best and worst rank by name.  A share ranks before another one only if its lower
        bound exceeds the other's upper bound.  Unknown shares have no ranks.
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
    """Format possible ranks as text, such as 1 or 2-4; empty if there are none."""
    if rank is None:
        return ""
    first, last = rank
    return f"{first}" if first == last else f"{first}-{last}"


def ranked(summary: Mapping[str, Any], key: str) -> list[tuple[str, list[float]]]:
    """Return the total variance share of each error for a quantity, largest first.

    Args:
        summary: result of :func:`forcefit.assembly.statistics.summary.summarise`.
        key: name of the quantity.

    Returns:
        Names with (value, lower, upper); empty if there are no shares.
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
    """Format the largest shares of a quantity's variance as a sentence.

    Args:
        shares: names with value, lower and upper bound, the largest first.
        quantity: name of the quantity.

    Returns:
        A sentence such as ``"position of bore 2 on link_a: 31 % of the variance of the
        translation (27 to 36 %); .."``.  Estimates and intervals from few draws may
        leave the range from 0 to 100 %; the sentence states the part within it.
    """
    parts = []
    for name, share in shares[:_IN_SENTENCE]:
        value, low, high = (100 * min(max(x, 0.0), 1.0) for x in share)
        parts.append(f"{name}: {value:.0f} % ({low:.0f} to {high:.0f} %)")
    parts[0] = parts[0].replace(" % (", f" % of the variance of the {quantity} (", 1)
    return "; ".join(parts)


def leaders(ranks: Mapping[str, Sequence[int]]) -> list[str]:
    """Return the names of all contributors that could rank first."""
    return [name for name, (first, _) in ranks.items() if first == 1]


def named_together(names: Iterable[str], among: Iterable[str]) -> list[str]:
    """Merge the names of contributors that occur in every leg.

    Args:
        names: names of the contributors, such as ``leg1.hinge.RX``.
        among: all names.

    Returns:
        ``hinge.RX of all legs`` if this component of every leg is among the names;
        other names, and the order of the names, stay unchanged.
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
    """Return the group name of an error ``hinge.RX`` by source, frame or kind."""
    return {
        "source": label, "frame": label.rpartition(".")[0], "kind": kind_of(label)
    }[by]  # fmt: skip


def kind_of(name: str) -> str:
    """Return the name of a frame or an error without the leg's name: ``hinge.RX``."""
    frame, dot, component = name.rpartition(".")
    if component not in SCREW:
        frame, dot, component = name, "", ""
    leg, in_leg, rest = frame.partition(".")
    return f"{rest if in_leg else leg}{dot}{component}"
