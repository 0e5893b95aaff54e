"""Scale error of the measuring device: measured length = factor x true length.

The origin of all positions is that of the measuring frame, or of the base if there is
no registration.
"""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.stiffness.screws import rotation_matrix


def _apply(conditions: Conditions, values: Values) -> Conditions:
    R = rotation_matrix(conditions.base[..., :3])
    at = np.einsum("...ij,...j->...i", R, conditions.measured_points)
    read = np.zeros((len(conditions), 6)) + conditions.reading
    at = at + conditions.base[..., 3:] + read[:, 3:]
    read[:, 3:] += (values.get("factor", 1.0) - 1.0) * at
    return replace(conditions, reading=read)


DEVICE_SCALE = Effect(
    name="device_scale",
    apply=_apply,
    unit=lambda robot, name: "1",
    frames=None,
    components=("factor",),
    unknowns=lambda robot: (Unknown("factor", 1e-4, 0.5, 2.0, 1.0),),
    by_row=True,
    device_alone=True,
)
