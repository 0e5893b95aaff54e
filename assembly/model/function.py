"""General effect: a small screw or a compliance as a function of variables.

:mod:`forcefit.assembly.effects.forms` defines the forms and their parameters;
:mod:`forcefit.assembly.effects.functions` applies the effect.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

KINDS = ("screw", "compliance")
PLACES = ("base", "reading", "load")  # places in addition to the frames of the robot


@dataclass(frozen=True)
class Function:
    """One ``[[effect]]`` of a robot file with the name ``function``.

    Attributes:
        where: place at which the effect acts: a frame, ``"base"``, ``"reading"`` or
            ``"load"``.
        components: ``rx`` .. ``tz`` of the screw at this place, in its axes; ``mx`` ..
            ``fz`` if ``where`` is ``"load"``.
        variables: one or two variables, such as ``q.drive``, ``load.fz`` or
            ``cov.temperature``.
        form: a name of :data:`forcefit.assembly.effects.forms.FORMS`, or ``"formula"``.
        parameters: numbers by name, in the units that follow from the variables and
            the kind; if the effect has several components, a name can begin with a
            component.
        kind: ``"screw"`` [rad, m], or ``"compliance"`` [rad/(N m), m/N], which is
            multiplied by the wrench component at the same place.
        label: text for reports.
        formula: the formula if ``form`` is ``"formula"``.
        session: name of the only session in which the effect acts; None for all.
        std: standard deviations of the parameters for which they are known, in the
            units of the parameters.
    """

    where: str
    components: tuple[str, ...]
    variables: tuple[str, ...]
    form: str
    parameters: Mapping[str, float]
    kind: str = "screw"
    label: str = ""
    formula: str = ""
    session: str | None = None
    std: Mapping[str, float] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Text for reports: the label, or else the place and the variables."""
        acts = f"{self.where} {', '.join(self.components)}"
        return self.label or f"{acts} of {', '.join(self.variables)}"
