"""Clearances of joints by the sizes of their contacts, as frames with bounds.

Each frame makes small turns about its own axes, or small shifts along them.  Frames in
series allow the sums of their motions.  Two chains of such frames between the same two
bodies, joined by a closure, allow the small screws that both chains allow.  All sets of
this table are exact.

======  ==================  ============================================================
chains  contacts            small screws that the contacts allow, in the joint's axes
======  ==================  ============================================================
1       bore of length L    ``|(TX, TY) + z (RY, -RX)| <= c`` at ``z = -L/2, L/2``
2       guide of length L,  ``|TX| + L/2 |RY| + t/2 |RZ| <= c_x`` and
        w by t              ``|TY| + L/2 |RX| + w/2 |RZ| <= c_y``
2       pad, 2A by 2B       ``|TZ| + B |RX| + A |RY| <= g``
======  ==================  ============================================================

- Bore: a small rotation about one end moves the shaft at the other end only.  So the
  two rotations of at most c / L, about one end each, move the two ends independently
  in discs of radius c.  Likewise in two bearings, of any heights and gaps.
- Guide: the four edges of the block stay within the gaps at both ends.  Each chain
  rolls about one edge, (w/2, t/2) or (-w/2, -t/2), without reaching a bound of the
  roll.  Its turns about y and x at both ends then move the faces that meet at this
  edge, by at most c_x and c_y:
  ``|TX - y RZ +- L/2 RY| <= c_x`` and ``|TY + x RZ -+ L/2 RX| <= c_y`` there.  Both
  edges together are the inequalities of the table.
- Pad: the four corners stay within the gap.  The first chain turns about the lines
  through two of three corners, and so moves each of the three by at most g.  In the
  second chain everything is free but the height of the fourth corner.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.model.robot import Clearance
from forcefit.stiffness.screws import transform


@dataclass(frozen=True, eq=False)
class Contact:
    """A frame of a joint that has only clearance.

    Attributes:
        suffix: of its name.
        pose: (4, 4) in the joint's axes.
        clearance: its bounds.
        fit: ISO 286 fit from whose mean the bounds follow, or empty.
        end: how they follow from it; its parts are those of a bearing, empty where
            the joint has one hole and one shaft.
        chain: 0 of the frames in series with the joint's own, 1 of those in parallel.
    """

    suffix: str
    pose: NDArray
    clearance: Clearance
    fit: str = ""
    end: FittedEnd | None = None
    chain: int = 0


def bearings(
    first: tuple[float, float], second: tuple[float, float], name: str = "bearing"
) -> tuple[Contact, ...]:
    """Return the contacts of a shaft along z in two bearings, or at a bore's two ends.

    Args:
        first: [m] height z and radial gap, half the diametral clearance.
        second: likewise, above the first.
        name: with which the names of the contacts begin.

    Returns:
        Two, whose sum is exactly the set of small screws of the shaft.
    """
    (z1, c1), (z2, c2) = first, second
    # a turn about one place moves the shaft at the other place only
    turns = ((f"{name}_start", z1, c2), (f"{name}_end", z2, c1))
    return tuple(
        Contact(suffix, _along_z(z), Clearance(tilt=gap / (z2 - z1)))
        for suffix, z, gap in turns
    )


def fitted(
    contacts: tuple[Contact, ...], fits: tuple[str, str], parts: tuple[str, str],
    length: float,
) -> tuple[Contact, ...]:  # fmt: skip
    """Return the contacts of :func:`bearings` with the fits of the two places.

    Args:
        contacts: two, for the mean radial clearances of the fits.
        fits: of the first and the second place; empty where its gap is stated.
        parts: names of the parts at the two places.
        length: [m] between the two places.
    """
    # a turn about one place moves the shaft at the other place only
    return tuple(
        replace(contact, fit=fit, end=FittedEnd(length, part)) if fit else contact
        for contact, fit, part in zip(contacts, fits[::-1], parts[::-1], strict=True)
    )


def guide(
    gaps: tuple[float, float],
    length: float,
    width: float,
    height: float,
    largest: tuple[float, float] | None = None,
) -> tuple[Contact, ...]:
    """Return the contacts of a block in a guide along z, its middle at the origin.

    Args:
        gaps: [m] c_x and c_y, along x and y from the middle to one side.
        length: [m] L of the guide, > 0.
        width: [m] w along x, > 0.
        height: [m] t along y, > 0.
        largest: [m] the largest gaps where they vary, as by a fit; by default `gaps`.

    Returns:
        Two chains, which roll about two opposite edges of the block.
    """
    edge = np.array([width / 2, height / 2, 0.0])
    # the slabs hold the roll within half of the bound of the first chain
    c_x, c_y = largest or gaps
    most = 2 * min(2 * c_y / width, 2 * c_x / height)
    rolls = Clearance(spin=most), Clearance(spin=np.inf, axial=np.inf)
    contacts: list[Contact] = []
    for chain, (name, side) in enumerate((("guide", 1.0), ("guide_far", -1.0))):
        at = transform(side * edge, np.eye(3))
        contacts.append(Contact(f"{name}_roll", at, rolls[chain], chain=chain))
        contacts += _tilts(name, gaps, length, chain)
    return tuple(contacts)


def _tilts(
    name: str, gaps: tuple[float, float], length: float, chain: int
) -> Iterator[Contact]:
    """Turns about y and x at both ends of a guide; each moves the other end only."""
    # columns: axes of a frame whose z is the joint's y, then x
    axes = np.eye(3)[:, [2, 0, 1]], np.eye(3)[:, [1, 2, 0]]
    for turn, gap, R in zip(("yaw", "pitch"), gaps, axes, strict=True):
        for end, z in (("start", -length / 2), ("end", length / 2)):
            pose = transform([0.0, 0.0, z], R)
            bound = Clearance(spin=gap / length)
            yield Contact(f"{name}_{turn}_{end}", pose, bound, chain=chain)


def fitted_guide(
    contacts: tuple[Contact, ...], fits: tuple[str, str], length: float
) -> tuple[Contact, ...]:
    """Return the contacts of :func:`guide` with the fits along x and y.

    Args:
        contacts: of a guide, for the mean gaps of the fits.
        fits: along x and y.
        length: [m] of the guide.
    """
    turns = {"yaw": (fits[0], "x"), "pitch": (fits[1], "y")}
    found = []
    for contact in contacts:
        fit, parts = next(
            (own for turn, own in turns.items() if f"_{turn}_" in contact.suffix),
            ("", ""),
        )
        end = FittedEnd(length, parts, "spin") if fit else None
        found.append(replace(contact, fit=fit, end=end))
    return tuple(found)


def pad(gap: float, length: float, width: float) -> tuple[Contact, ...]:
    """Return the contacts of a rectangular pad between two planes, normal to z.

    Args:
        gap: [m] g from the middle to one plane.
        length: [m] 2A along x, > 0.
        width: [m] 2B along y, > 0.

    Returns:
        Two chains: the turns by which three corners move, and the fourth corner.
    """
    A, B = length / 2, width / 2
    corners = np.array([[A, B, 0.0], [-A, B, 0.0], [-A, -B, 0.0], [A, -B, 0.0]])
    contacts = []
    for k, (here, one, other) in enumerate(((0, 1, 2), (1, 2, 0), (2, 0, 1)), 1):
        # a turn about the line through two corners moves the third alone
        line = corners[other] - corners[one]
        along = line / np.linalg.norm(line)
        across = np.cross([0.0, 0.0, 1.0], along)
        arm = abs(across @ (corners[here] - corners[one]))
        R = np.column_stack([across, [0.0, 0.0, 1.0], along])
        turn = Clearance(spin=float(gap / arm))
        contacts.append(Contact(f"pad_{k}", transform(corners[one], R), turn))
    free = Clearance(tilt=np.inf, spin=np.inf, radial=np.inf, axial=gap)
    last = transform(corners[3], np.eye(3))
    return (*contacts, Contact("pad_4", last, free, chain=1))


def _along_z(z: float) -> NDArray:
    """Return the (4, 4) frame at a height z, parallel to the joint's axes."""
    return transform([0.0, 0.0, z], np.eye(3))
