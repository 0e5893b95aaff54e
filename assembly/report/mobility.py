"""Mobility of a robot as a dictionary and as text."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from forcefit.assembly.kinematics.mobility import (
    mobility,
    mobility_near,
    platform_screws,
)
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.pure_motions import PureMotion, pure_motions
from forcefit.results.display import listing
from forcefit.results.text import lines_of

# ratio of singular values below which a rank is uncertain
CERTAIN = 100.0
_FREE = ("freedom", "freedoms")
_OVER = ("over-constraint", "over-constraints")
_VERBS = {
    "translation": "translates along",
    "turn": "turns about",
    "screw": "screws along",
}


def shown_of(posture: Posture) -> dict[str, Any]:
    """Return the results of ``assembly show``.

    Args:
        posture: posture of the robot.

    Returns:
        Pose, mobility and remarks. For each frame, its origin [m] and its x and z axes
        in base axes.
    """
    robot = posture.robot
    axes = {
        frame.name: {"at": T[:3, 3], "x": T[:3, 0], "z": T[:3, 2]}
        for frame, T in zip(robot.frames, posture.transforms, strict=True)
    }
    return {
        "robot": robot.name,
        "pose": posture.pose(),
        "mobility": mobility_of(posture),
        "remarks": list(robot.remarks),
        "axes": axes,
    }


def shown_text(results: Mapping[str, Any]) -> str:
    """Format the results of :func:`shown_of` as text."""
    lines = lines_of(results, "pose") | mobility_lines(results["mobility"])
    return listing(results["robot"], lines, results["remarks"])


def mobility_of(posture: Posture) -> dict[str, Any]:
    """Return the mobility at a posture as a dictionary.

    Args:
        posture: posture of the robot.

    Returns:
        The attributes of :class:`forcefit.assembly.kinematics.mobility.Mobility`, the
        platform motions, and whether the posture is singular. For a singular posture,
        the attributes at a nearby posture are included.
    """
    here = mobility(posture)
    near = mobility_near(posture, here)
    counts = vars(here) | {"motions": _motions(posture)}
    counts |= {"counts_certain": here.singular_value_gap >= CERTAIN}
    there = near.there or here
    singular = near.freedoms < here.freedoms
    singular |= there.freedoms_drives_locked < here.freedoms_drives_locked
    if singular and near.there is not None:
        # Motions at nearby postures are omitted, because operation modes may intersect
        # at a singular posture.
        counts["near"] = vars(near.there)
    counts |= {"singular": singular, "finite_freedoms": near.freedoms}
    return counts | {"words": mobility_words(counts)}


def _motions(posture: Posture) -> list[dict[str, Any]]:
    """Return the platform motions as dictionaries without empty values."""
    screws, error = platform_screws(posture)
    motions = pure_motions(
        screws, posture.platform[:3, 3], size_of(posture.robot), error
    )
    return [
        {k: v for k, v in vars(motion).items() if v is not None} for motion in motions
    ]


def mobility_words(counts: Mapping[str, Any]) -> str:
    """Format degrees of freedom, platform motions and over-constraints as text.

    Args:
        counts: result of :func:`mobility_of`.

    Returns:
        Text such as "3 freedoms: translates along x, y, z; 12 over-constraints".
    """
    total, moved = counts["freedoms"], counts["platform_freedoms"]
    text = _number(total, *_FREE)
    if total > moved:
        text += f", {moved or 'none'} of the platform"
    motions = [PureMotion(**motion) for motion in counts["motions"]]
    if motions:
        text += f": {motion_words(motions)}"
    return f"{text}; {_number(counts['overconstraint'], *_OVER)}"


def motion_words(motions: Sequence[PureMotion]) -> str:
    """Format the motions of a body as text.

    Args:
        motions: result of
            :func:`forcefit.assembly.kinematics.pure_motions.pure_motions`.

    Returns:
        Text such as "translates along z and turns about x, y through (0, 0, 0.4) m".
    """
    slides = [m for m in motions if m.kind == "translation"]
    others = [m for m in motions if m.kind != "translation"]
    screws = any(m.kind == "screw" for m in others)
    texts = [_of_kind("translation", slides)] if slides else []
    if screws and len(others) > 1:
        pitches = ", ".join(f"{_plain(1e3 * (m.pitch or 0.0))}" for m in others)
        order = f"moves in a screw system of order {len(others)}"
        texts.append(f"{order}, principal pitches {pitches} mm per turn")
    else:
        texts += [_of_kind(k, list(group)) for k, group in groupby(others, _kind)]
    return " and ".join(texts)


def _kind(motion: PureMotion) -> str:
    """Return the kind of a motion."""
    return motion.kind


def _of_kind(kind: str, motions: Sequence[PureMotion]) -> str:
    """Format motions of one kind as text."""
    along = ", ".join(_direction(motion.direction) for motion in motions)
    text = f"{_VERBS[kind]} {along}"
    first = motions[0]
    if first.point is not None:
        text += f" through ({', '.join(map(_plain, first.point))}) m"
    if first.pitch is not None:
        text += f", pitch {_plain(1e3 * first.pitch)} mm per turn"
    return text


def _direction(d: Any) -> str:
    """Format a direction as an axis name or as components."""
    k = int(np.argmax(np.abs(d)))
    if abs(d[k]) > 1 - 1e-9:
        return "xyz"[k]
    return f"({', '.join(map(_plain, d))})"


def _plain(value: float) -> str:
    """Format a number with 4 digits."""
    return f"{0.0 if abs(value) < 1e-9 else value:.4g}"


def _number(count: int, one: str, many: str) -> str:
    """Format a number and its noun, in the singular or in the plural."""
    return f"{count} {one if count == 1 else many}"


def mobility_lines(counts: Mapping[str, Any]) -> dict[str, str]:
    """Format the mobility as lines of text, by title.

    Args:
        counts: result of :func:`mobility_of`.

    Returns:
        Lines for the mobility, the degrees of freedom with locked drives, redundant
        drives, a singular posture and uncertain numbers.
    """
    lines = {"mobility": counts["words"]}
    if held := counts["freedoms_drives_locked"]:
        inner = counts["platform_freedoms_drives_locked"] or "none"
        text = f"{_number(held, *_FREE)}, {inner} of the platform"
        lines["drives locked"] = text
    if spare := counts["actuation_redundancy"]:
        lines["redundant drives"] = str(spare)
    if counts["singular"]:
        lines["singular posture"] = _singular(counts)
    if not counts["counts_certain"]:
        gap = counts["singular_value_gap"]
        lines["counts not certain"] = (
            f"nonzero and zero singular values differ only by a factor of {gap:.3g}"
        )
    return lines


def _singular(counts: Mapping[str, Any]) -> str:
    """Format the mobility near a singular posture as text."""
    if "near" not in counts:
        finite = _number(counts["finite_freedoms"], *_FREE)
        return f"motions at first order only, {finite} of finite size"
    near = counts["near"]
    return (
        f"near it {_number(near['freedoms'], *_FREE)}, "
        f"{near['freedoms_drives_locked']} with drives locked; "
        f"{_number(near['overconstraint'], *_OVER)}"
    )
