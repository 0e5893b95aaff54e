"""Poses of the frames of a tree of joints, each about or along its z axis."""

import numpy as np
from numpy.typing import NDArray


def place_frames(
    parents: NDArray,
    kinds: NDArray,
    fixed: NDArray,
    q: NDArray,
    leads: NDArray | float = 0.0,
) -> tuple[NDArray, NDArray]:
    """Return the poses of all frames, before and after the motion of their joint.

    Args:
        parents: (n,) index of each parent, which precedes its children; -1 for the
            base.
        kinds: (n,) kind of each joint: 0 fixed, 1 revolute or helical, 2 prismatic.
        fixed: (n, 4, 4) poses of the frames in their parents.
        q: (n,) [rad or m] coordinates.
        leads: (n,) [m/rad] translation per angle of helical joints; 0 for others.

    Returns:
        (n, 4, 4) poses before and (n, 4, 4) poses after the motion, in base axes.
    """
    angle = np.where(kinds == 1, q, 0.0)
    motion = np.zeros((len(q), 4, 4))
    motion[:, range(4), range(4)] = 1.0
    motion[:, 0, 0] = motion[:, 1, 1] = np.cos(angle)
    motion[:, 1, 0] = np.sin(angle)
    motion[:, 0, 1] = -motion[:, 1, 0]
    motion[:, 2, 3] = np.where(kinds == 2, q, leads * angle)
    before, after = np.empty_like(motion), np.empty_like(motion)
    for i, parent in enumerate(parents.tolist()):
        before[i] = fixed[i] if parent < 0 else after[parent] @ fixed[i]
        after[i] = before[i] @ motion[i]
    return before, after
