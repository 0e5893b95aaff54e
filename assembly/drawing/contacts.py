"""Clearances of joints by the sizes of their contacts, as frames in series.

Each frame turns a little about its own axes, and the small screws that the contacts
allow are the sums of these turns: exactly for a bore.  The sets of a guide and of a pad
are no such sums; these sums contain them, so that largest errors are on the safe side.

========  ==================  ==========================================================
frames    contacts            small screws that the contacts allow, in the joint's axes
========  ==================  ==========================================================
2         bore of length L    ``|(TX, TY) + z (RY, -RX)| <= c`` at ``z = -L/2, L/2``
4, joint  guide of length L,  ``|TX| + L/2 |RY| + t/2 |RZ| <= c_x`` and
          w by t              ``|TY| + L/2 |RX| + w/2 |RZ| <= c_y``
4         pad, 2A by 2B       ``|TZ| + B |RX| + A |RY| <= g``
========  ==================  ==========================================================

- Bore: a small rotation about one end moves the shaft at the other end only.  So the
  two rotations of at most c / L, about one end each, move the two ends independently
  in discs of radius c.  Likewise in two bearings, of any heights and gaps.
- Guide: likewise about x and y alone, and RZ between its largest values independently
  of the others.  Exact without RZ; the volume is 3 to 5 times that of the guide.
- Pad: turns about the four lines that join the middles of neighbouring sides.  Exact
  along TZ, RX and RY alone; the volume is 1.5 times that of the pad.
"""

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
    """

    suffix: str
    pose: NDArray
    clearance: Clearance
    fit: str = ""
    end: FittedEnd | None = None


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


def guide(gaps: tuple[float, float], length: float) -> tuple[Contact, ...]:
    """Return the contacts of a block in a guide along z, its middle at the origin.

    Args:
        gaps: [m] c_x and c_y, along x and y from the middle to one side.
        length: [m] L of the guide, > 0.

    Returns:
        Four: turns about y and x at both ends.  The roll is not among them.
    """
    contacts = []
    # columns: axes of a frame whose z is the joint's y, then x
    axes = np.eye(3)[:, [2, 0, 1]], np.eye(3)[:, [1, 2, 0]]
    for name, gap, R in zip(("yaw", "pitch"), gaps, axes, strict=True):
        for end, z in (("start", -length / 2), ("end", length / 2)):
            turn = Clearance(spin=gap / length)
            pose = transform([0.0, 0.0, z], R)
            contacts.append(Contact(f"guide_{name}_{end}", pose, turn))
    return tuple(contacts)


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


def largest_roll(gaps: tuple[float, float], width: float, height: float) -> float:
    """Return the largest roll of a block in its guide.

    Args:
        gaps: [m] c_x and c_y.
        width: [m] w along x, > 0.
        height: [m] t along y, > 0.

    Returns:
        [rad] the lesser of 2 c_y / w and 2 c_x / t.
    """
    return min(2 * gaps[1] / width, 2 * gaps[0] / height)


def pad(gap: float, length: float, width: float) -> tuple[Contact, ...]:
    """Return the contacts of a rectangular pad between two planes, normal to z.

    Args:
        gap: [m] g from the middle to one plane.
        length: [m] 2A along x, > 0.
        width: [m] 2B along y, > 0.

    Returns:
        Four turns about lines in the plane of the pad.
    """
    contacts = []
    for k, (s, t) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1)), 1):
        # TZ = g / 4 at the middle, with g / 4 more or less at the middles of the sides
        rotation = np.array([s * gap / (2 * width), t * gap / (2 * length), 0.0])
        turn = Clearance(spin=float(np.linalg.norm(rotation)))
        along = np.array([s * length, t * width, 0.0]) / np.hypot(length, width)
        across = np.cross([0.0, 0.0, 1.0], along)
        R = np.column_stack([across, [0.0, 0.0, 1.0], along])
        middle = -length * width / (2 * np.hypot(length, width)) * across
        contacts.append(Contact(f"pad_{k}", transform(middle, R), turn))
    return tuple(contacts)


def _along_z(z: float) -> NDArray:
    """Return the (4, 4) frame at a height z, parallel to the joint's axes."""
    return transform([0.0, 0.0, z], np.eye(3))
