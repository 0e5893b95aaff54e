"""Joint clearances that follow from the dimensions of contacts.

Contacts are represented by frames with clearance bounds.  Each frame allows small
rotations about its axes or small translations along them, and the motions of frames in
series add up.  Two chains of such frames between the same two bodies, connected by a
closure, allow the small screws that are possible in both chains.  The following sets
are represented exactly:

======  ==================  ============================================================
chains  contacts            small screws that the contacts allow, in the joint's axes
======  ==================  ============================================================
1       bore of length L    ``|(TX, TY) + z (RY, -RX)| <= c`` at ``z = -L/2, L/2``
2       guide of length L,  ``|TX| + L/2 |RY| + t/2 |RZ| <= c_x`` and
        w by t              ``|TY| + L/2 |RX| + w/2 |RZ| <= c_y``
2       pad, 2A by 2B       ``|TZ| + B |RX| + A |RY| <= g``
======  ==================  ============================================================

- Bore: a small rotation about one end moves the shaft only at the other end.  Two
  rotations by at most c / L, one about each end, therefore move the two ends
  independently within discs of radius c.  The same applies to two bearings with any
  heights and gaps.
- Guide: the four edges of the block stay within the gaps at both ends.  Each chain
  rolls about one edge, (w/2, t/2) or (-w/2, -t/2), without reaching a bound of the
  roll.  The rotations about y and x at both ends of the chain then move the faces that
  meet at this edge by at most c_x and c_y:
  ``|TX - y RZ +- L/2 RY| <= c_x`` and ``|TY + x RZ -+ L/2 RX| <= c_y`` there.  Both
  edges together result in the inequalities of the table.
- Pad: the four corners stay within the gap.  The first chain rotates about the lines
  through two of three corners, and so moves each of the three by at most g.  In the
  second chain, only the height of the fourth corner is bounded.

The double cone of a disc pad, ``|TZ| + r |(RX, RY)| <= g``, is not such a set.  Each
cone of a clearance is a ball of fixed radius, which has one tangent plane at each point
of its boundary.  The directions that lead from a point into an intersection of such
balls, or into its image, therefore fill a polyhedral cone.  At the tip of the double
cone, they fill a circular cone.
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
    """Frame of a joint that provides only clearance.

    Attributes:
        suffix: suffix of the frame name.
        pose: pose in the joint axes (4, 4).
        clearance: clearance bounds.
        fit: ISO 286 fit whose mean clearance determines the bounds, or empty.
        end: fitted end that relates the bounds to the fit; its parts are those of a
            bearing, or empty if the joint has one hole and one shaft.
        chain: 0 for frames in series with the joint frame, 1 for frames in parallel.
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
    """Return the contacts of a shaft along z in two bearings or two ends of a bore.

    Args:
        first: height z and radial gap of the lower bearing or bore end [m]. The radial
            gap is half the diametral clearance.
        second: height z and radial gap of the upper bearing or bore end [m].
        names: names of both contacts.

    Returns:
        Two contacts, which in series allow exactly the small screws of the shaft.
    """
    (z1, c1), (z2, c2) = first, second
    # a rotation about one place moves the shaft only at the other place
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
        contacts: two contacts, computed for the mean radial clearances of the fits.
        fits: fits at the first and second contact; empty if the gap is given.
        parts: names of the parts at both contacts.
        length: distance between both contacts [m].
    """
    # a rotation about one place moves the shaft only at the other place
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
        gaps: gaps c_x and c_y between the centred block and one side along x and y [m].
        length: length L of the guide [m], > 0.
        width: width w along x [m], > 0.
        height: height t along y [m], > 0.
        largest: maximum gaps if they vary, for example in a fit [m]; `gaps` by default.

    Returns:
        Contacts in two chains, which roll about opposite edges of the block.
    """
    edge = np.array([width / 2, height / 2, 0.0])
    # the gaps limit the roll of the block to half of the bound set here
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
    """Yield rotations at both ends of a guide; each moves only the other end."""
    # columns: axes of a frame whose z is the joint's y, then the joint's x
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
        contacts: contacts of a guide, computed for the mean gaps of the fits.
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
        gap: gap g between the centred pad and one plane [m], or its mean for a fit.
        length: length 2A along x [m], > 0.
        width: width 2B along y [m], > 0.
        fit: fit between the distance of the planes and the pad thickness, or empty.

    Returns:
        Contacts in two chains: the first one moves three corners by rotations, the
        second one moves the fourth corner.  With a fit, the fourth corner is moved by a
        rotation as well, because the fit then determines only rotations.
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
    """Return the frame at height z (4, 4), parallel to the joint axes."""
    return transform([0.0, 0.0, z], np.eye(3))
