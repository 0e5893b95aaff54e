"""Nonlinear contact stiffness of a joint: load = coefficient |deflection|^exponent.

Sources:
    Johnson, Contact Mechanics, section 4.2 (Hertz: exponent 1.5 for spheres).
"""

from dataclasses import replace

from forcefit.assembly.effects.effect import RIGID, Effect, Unknown, Values
from forcefit.assembly.effects.places import drives, own_unit
from forcefit.assembly.measurement.conditions import Conditions, ContactLaw
from forcefit.assembly.model.robot import Robot


def _apply(conditions: Conditions, values: Values) -> Conditions:
    laws = tuple(
        ContactLaw(
            key.removesuffix(".coefficient"), coefficient,
            values.get(key.removesuffix("coefficient") + "exponent", 1.5),
        )
        for key, coefficient in values.items()
        if key.endswith(".coefficient")
    )  # fmt: skip
    return replace(conditions, laws=conditions.laws + laws)


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Convert the deflection d under a unit load to the coefficient d^(-exponent)."""
    parameters: dict[str, float] = {}
    for key, deflection in values.items():
        name, _, kind = key.rpartition(".")
        exponent = values.get(f"{name}.exponent", 1.5)
        if kind == "give" and deflection > RIGID:
            parameters[f"{name}.coefficient"] = deflection**-exponent
            parameters[f"{name}.exponent"] = exponent
    return parameters


def _unit(robot: Robot, name: str) -> str:
    frame, _, kind = name.rpartition(".")
    if kind == "exponent":
        return "1"
    return "N m/rad^n" if own_unit(robot, frame) == "rad" else "N/m^n"


CONTACT_STIFFENING = Effect(
    name="contact_stiffening",
    apply=_apply,
    unit=_unit,
    frames=drives,
    components=("coefficient", "exponent"),
    unknowns=lambda robot: (
        Unknown("give", 1e-6, 0.0, 1.0),
        Unknown("exponent", 0.5, 1.05, 6.0, scan=(1.5, 2.0, 3.0)),
    ),
    public=_public,
    linear=False,
)  # fmt: skip
