"""Clearances of joints by the sizes of their contacts, as frames in series.

Each frame turns a little about its own axes, and the sum of their motions is the set of
positions that the contacts leave.  It is exact for a bore, and contains the set of a
guide and of a pad.

======  ====================  ==========================================================
frames  contacts              set of the small screws, in the joint's axes
======  ====================  ==========================================================
2       bore of length L      ``|(TX, TY) + z (RY, -RX)| <= c`` at ``z = -L/2, L/2``
4, own  guide of length L     ``|TX| + L/2 |RY| + t/2 |RZ| <= c_x`` and
                              ``|TY| + L/2 |RX| + w/2 |RZ| <= c_y``
4       pad, 2A by 2B         ``|TZ| + B |RX| + A |RY| <= g``
======  ====================  ==========================================================

A small rotation about one end of a bore moves the shaft at the other end only.  So the
two rotations of at most c / L, about one end each, move the two ends independently in
discs of radius c.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.model.robot import Clearance
from stiffness.screws import transform


@dataclass(frozen=True, eq=False)
class Contact:
    """A frame of a joint that has only clearance.

    Attributes:
        suffix: of its name.
        pose: (4, 4) in the joint's axes.
        clearance: its bounds.
    """

    suffix: str
    pose: NDArray
    clearance: Clearance


def bore(radial: float, length: float) -> tuple[Contact, ...]:
    """Return the contacts of a shaft in a bore about z, its middle at the origin.

    Args:
        radial: [m] gap c between shaft and bore, half the diametral clearance.
        length: [m] L of the bore, > 0.

    Returns:
        Two, whose sum is exactly the set of small screws of the shaft.
    """
    tilt = Clearance(tilt=radial / length)
    ends = (("bore_start", -length / 2), ("bore_end", length / 2))
    return tuple(Contact(name, _along_z(z), tilt) for name, z in ends)


def _along_z(z: float) -> NDArray:
    """Return the (4, 4) frame at a height z, parallel to the joint's axes."""
    return transform([0.0, 0.0, z], np.eye(3))
