"""Library of physical effects, such as friction and thermal expansion.

Start with ``effect.py``, which defines an effect.  ``library.py`` adds the effects of
other distributions.  Effects are applied in the order of :data:`LIBRARY`.  Friction
acts on a joint's spring, so drive compliance is applied before friction.  The elastic
foundation adds a frame, so it is applied last.
"""

from collections.abc import Mapping

from forcefit.assembly.effects.base_compliance import BASE_COMPLIANCE
from forcefit.assembly.effects.body_mass import BODY_MASS
from forcefit.assembly.effects.contact_stiffening import CONTACT_STIFFENING
from forcefit.assembly.effects.delayed_expansion import DELAYED_EXPANSION
from forcefit.assembly.effects.device_scale import DEVICE_SCALE
from forcefit.assembly.effects.drift import DRIFT
from forcefit.assembly.effects.drive_compliance import DRIVE_COMPLIANCE
from forcefit.assembly.effects.effect import Values
from forcefit.assembly.effects.encoder_eccentricity import ENCODER_ECCENTRICITY
from forcefit.assembly.effects.encoder_offset import ENCODER_OFFSET
from forcefit.assembly.effects.friction_hysteresis import FRICTION_HYSTERESIS
from forcefit.assembly.effects.functions import apply_functions, in_session_alone
from forcefit.assembly.effects.geometric_stiffening import GEOMETRIC_STIFFENING
from forcefit.assembly.effects.joint_clearance import JOINT_CLEARANCE
from forcefit.assembly.effects.library import Library
from forcefit.assembly.effects.link_length import LINK_LENGTH
from forcefit.assembly.effects.load_gain import LOAD_GAIN
from forcefit.assembly.effects.modulus_scale import MODULUS_SCALE
from forcefit.assembly.effects.registration import REGISTRATION
from forcefit.assembly.effects.self_weight import SELF_WEIGHT
from forcefit.assembly.effects.thermal_expansion import THERMAL_EXPANSION
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot

LIBRARY = Library((
    SELF_WEIGHT,
    THERMAL_EXPANSION,
    DELAYED_EXPANSION,
    DRIVE_COMPLIANCE,
    ENCODER_OFFSET,
    ENCODER_ECCENTRICITY,
    LINK_LENGTH,
    REGISTRATION,
    DEVICE_SCALE,
    MODULUS_SCALE,
    BODY_MASS,
    JOINT_CLEARANCE,
    FRICTION_HYSTERESIS,
    CONTACT_STIFFENING,
    LOAD_GAIN,
    GEOMETRIC_STIFFENING,
    DRIFT,
    BASE_COMPLIANCE,
))


def apply_effects(conditions: Conditions, effects: Mapping[str, Values]) -> Conditions:
    """Return the conditions with effects added.

    Args:
        conditions: conditions without these effects.
        effects: parameters of each effect by public name.

    Returns:
        The conditions with all of these effects applied.

    Raises:
        KeyError: an effect is not in the library.
    """
    unknown = set(effects) - set(LIBRARY)
    if unknown:
        raise KeyError(
            f"unknown effects {sorted(unknown)}; available: {sorted(LIBRARY)}"
        )
    for name in LIBRARY:
        if name in effects:
            conditions = LIBRARY[name].apply(conditions, effects[name])
    return conditions


def apply_known(conditions: Conditions, robot: Robot) -> Conditions:
    """Apply all effects in the file of a robot.

    Args:
        conditions: conditions of R measurements of the robot without effects.
        robot: robot with these effects.

    Returns:
        The conditions with the effects and functions of the robot and of each session.
    """
    recorded = conditions
    conditions = apply_effects(conditions, robot.effects)
    for session, effects in robot.session_effects.items():
        changed = apply_effects(conditions, effects)
        conditions = in_session_alone(conditions, changed, session)
    return apply_functions(conditions, robot.functions, recorded)
