"""General effect: a small screw or a compliance that depends on variables.

:mod:`forcefit.assembly.effects.forms` defines the forms and their parameters;
:mod:`forcefit.assembly.effects.functions` applies the effect.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

KINDS = ("screw", "compliance")
PLACES = ("base", "reading", "load")  # places in addition to the frames of the robot


@dataclass(frozen=True)
class Function:
    """Entry ``[[effect]]`` of a robot file with the name ``function``.

    Attributes:
        where: place at which the effect acts: a frame, ``"base"``, ``"reading"`` or
            ``"load"``.
        components: screw components ``rx`` .. ``tz`` in the axes of this place, or
            ``mx`` .. ``fz`` if ``where`` is ``"load"``.
        variables: one or two variables, for example ``q.drive``, ``load.fz`` or
            ``cov.temperature``.
        form: key of :data:`forcefit.assembly.effects.forms.FORMS`, or ``"formula"``.
        parameters: values by name, in units that follow from the variables and the
            kind.  If the effect has several components, names may be prefixed with a
            component.
        kind: ``"screw"`` [rad, m], or ``"compliance"`` [rad/(N m), m/N], which is
            multiplied by the wrench component at the same place.
        label: name used in reports.
        formula: formula, if ``form`` is ``"formula"``.
        session: the only session in which the effect acts; None for all sessions.
        std: standard deviations of parameters, where known, in parameter units.
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
        """Name used in reports: the label, otherwise the place and the variables."""
        acts = f"{self.where} {', '.join(self.components)}"
        return self.label or f"{acts} of {', '.join(self.variables)}"
