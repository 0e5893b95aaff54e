"""Forward kinematics of a tree of joints, which move about or along their z axes."""

import numpy as np
from numpy.typing import NDArray


def place_frames(
    parents: NDArray,
    kinds: NDArray,
    fixed: NDArray,
    q: NDArray,
    leads: NDArray | float = 0.0,
) -> tuple[NDArray, NDArray]:
    """Return the poses of all frames before and after the motion of their joints.

    Args:
        parents: index of the parent of each joint, (n,); -1 for the base.  Parents
            precede their children.
        kinds: type of each joint, (n,): 0 fixed, 1 revolute or helical, 2 prismatic.
        fixed: poses of the frames relative to their parents, (n, 4, 4).
        q: coordinates, (n,) [rad or m].
        leads: translation per angle of helical joints, (n,) [m/rad]; 0 for other
            joints.

    Returns:
        Poses relative to the base before the motion, (n, 4, 4), and after the motion,
        (n, 4, 4).
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
