"""Joint clearances that follow from the dimensions of contacts.

Contacts are represented by frames with clearance bounds.  Each frame permits small
rotations about its axes or small translations along them, and the motions of frames in
series add up.  Two chains of frames between the same two bodies permit the small screws
that are possible in both chains.  The following sets are represented exactly:

======  ==================  ============================================================
chains  contacts            small screws that the contacts permit, in joint axes
======  ==================  ============================================================
1       bore of length L    ``|(TX, TY) + z (RY, -RX)| <= c`` at ``z = -L/2, L/2``
2       guide of length L,  ``|TX| + L/2 |RY| + t/2 |RZ| <= c_x`` and
        w by t              ``|TY| + L/2 |RX| + w/2 |RZ| <= c_y``
2       pad, 2A by 2B       ``|TZ| + B |RX| + A |RY| <= g``
======  ==================  ============================================================

- Bore: a small rotation about one end of the bore moves the shaft only at the other
  end.  Rotations by at most c / L about both ends therefore move the ends independently
  within discs of radius c.  The same applies to two bearings with different clearances.
- Guide: the four edges of the block remain within the gaps at both ends of the guide.
  Each chain permits a rotation about z at one edge, (w/2, t/2) or (-w/2, -t/2).  The
  rotations about y and x at both ends move the two faces at this edge by at most c_x
  and c_y: ``|TX - y RZ +- L/2 RY| <= c_x`` and ``|TY + x RZ -+ L/2 RX| <= c_y``.  The
  inequalities for both edges are equivalent to those in the table.
- Pad: the four corners remain within the gap.  The first chain rotates about the lines
  through two of three corners, which moves each of these corners by at most g.  The
  second chain limits the displacement of the fourth corner.

The double cone of a circular pad, ``|TZ| + r |(RX, RY)| <= g``, cannot be represented
exactly, because its tangent cone at the tip is not polyhedral.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.model.joint_names import BEARING, GUIDE, GUIDE_FAR, PAD
from forcefit.assembly.model.robot import Clearance
from forcefit.stiffness.screws import transform


@dataclass(frozen=True, eq=False)
class Contact:
    """Frame that represents a clearance of a joint.

    Attributes:
        suffix: suffix of the frame name.
        pose: pose relative to the joint, (4, 4).
        clearance: clearance bounds.
        fit: ISO 286 fit whose mean clearance determines the bounds, or empty.
        end: relation between the fit and the bounds, or None.
        chain: 0 for frames in series with the joint frame, 1 for the second chain.
    """

    suffix: str
    pose: NDArray
    clearance: Clearance
    fit: str = ""
    end: FittedEnd | None = None
    chain: int = 0


def bearings(
    first: tuple[float, float], second: tuple[float, float],
    names: tuple[str, str] = BEARING,
) -> tuple[Contact, ...]:  # fmt: skip
    """Return the contacts of a shaft along z in two bearings or a bore.

    Args:
        first: height z and radial clearance of the lower bearing or bore end [m]. The
            radial clearance is half the diametral clearance.
        second: height z and radial clearance of the upper bearing or bore end [m].
        names: names of both contacts.

    Returns:
        Two contacts in series.
    """
    (z1, c1), (z2, c2) = first, second
    # a rotation about one bearing moves the shaft only at the other bearing
    turns = zip(names, ((z1, c2), (z2, c1)), strict=True)
    return tuple(
        Contact(suffix, _along_z(z), Clearance(tilt=gap / (z2 - z1)))
        for suffix, (z, gap) in turns
    )


def fitted(
    contacts: tuple[Contact, ...], fits: tuple[str, str], parts: tuple[str, str],
    length: float,
) -> tuple[Contact, ...]:  # fmt: skip
    """Return the contacts of :func:`bearings` with fits.

    Args:
        contacts: two contacts with the mean radial clearances of the fits.
        fits: fits at the first and second contact; empty without a fit.
        parts: common names of hole and shaft at both contacts.
        length: distance between both contacts [m].
    """
    # a rotation about one bearing moves the shaft only at the other bearing
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
    """Return the contacts of a block in a guide along z, centred at the origin.

    Args:
        gaps: gaps c_x and c_y on each side of the centred block along x and y [m].
        length: length L of the guide [m], > 0.
        width: width w along x [m], > 0.
        height: height t along y [m], > 0.
        largest: maximum gaps of a fit [m]; ``gaps`` by default.

    Returns:
        Contacts of two chains of frames.  The chains rotate about opposite edges of the
        block.
    """
    edge = np.array([width / 2, height / 2, 0.0])
    # the bound on RZ is inactive, because the gaps limit RZ to half of this bound
    c_x, c_y = largest or gaps
    most = 2 * min(2 * c_y / width, 2 * c_x / height)
    rolls = Clearance(spin=most), Clearance(spin=np.inf, axial=np.inf)
    contacts: list[Contact] = []
    for chain, (names, side) in enumerate(((GUIDE, 1.0), (GUIDE_FAR, -1.0))):
        at = transform(side * edge, np.eye(3))
        contacts.append(Contact(names[0], at, rolls[chain], chain=chain))
        contacts += _tilts(names[1:], gaps, length, chain)
    return tuple(contacts)


def _tilts(
    names: tuple[str, ...], gaps: tuple[float, float], length: float, chain: int
) -> Iterator[Contact]:
    """Yield contacts that rotate about both ends of a guide."""
    # rotations of a frame whose z axis is y, or x, of the joint
    axes = np.eye(3)[:, [2, 0, 1]], np.eye(3)[:, [1, 2, 0]]
    ends = product(zip(gaps, axes, strict=True), (-length / 2, length / 2))
    for name, ((gap, R), z) in zip(names, ends, strict=True):
        bound = Clearance(spin=gap / length)
        yield Contact(name, transform([0.0, 0.0, z], R), bound, chain=chain)


def fitted_guide(
    contacts: tuple[Contact, ...], fits: tuple[str, str], length: float
) -> tuple[Contact, ...]:
    """Return the contacts of :func:`guide` with fits along x and y.

    Args:
        contacts: contacts of a guide with the mean gaps of the fits.
        fits: fits along x and y.
        length: length of the guide [m].
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


def pad(gap: float, length: float, width: float, fit: str = "") -> tuple[Contact, ...]:
    """Return the contacts of a rectangular pad between two planes normal to z.

    Args:
        gap: gap g on each side of the centred pad [m], or its mean for a fit.
        length: length 2A along x [m], > 0.
        width: width 2B along y [m], > 0.
        fit: fit between the distance of the planes and the pad thickness, or empty.

    Returns:
        Contacts in two chains.  The first chain moves three corners by rotations, and
        the second chain moves the fourth corner.
    """
    A, B = length / 2, width / 2
    corners = np.array([[A, B, 0.0], [-A, B, 0.0], [-A, -B, 0.0], [A, -B, 0.0]])
    contacts = []
    turns = [(0, 1, 2), (1, 2, 0), (2, 0, 1)] + [(3, 0, 2)] * bool(fit)
    for k, (here, one, other) in enumerate(turns):
        # a rotation about the line through two corners moves only the third corner
        line = corners[other] - corners[one]
        along = line / np.linalg.norm(line)
        across = np.cross([0.0, 0.0, 1.0], along)
        arm = abs(across @ (corners[here] - corners[one]))
        R = np.column_stack([across, [0.0, 0.0, 1.0], along])
        turn = Clearance(spin=float(gap / arm))
        end = FittedEnd(float(arm), "", "spin") if fit else None
        pose, chain = transform(corners[one], R), int(here == 3)
        contacts.append(Contact(PAD[k], pose, turn, fit, end, chain))
    height = None if fit else gap
    free = Clearance(tilt=np.inf, spin=np.inf, radial=np.inf, axial=height)
    last = transform(corners[3], np.eye(3))
    return (*contacts, Contact(PAD[len(turns)], last, free, chain=1))


def _along_z(z: float) -> NDArray:
    """Return the translation along z by a height, (4, 4)."""
    return transform([0.0, 0.0, z], np.eye(3))
