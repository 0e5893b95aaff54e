"""Effects that are functions of variables: a small screw or a compliance.

:mod:`forcefit.assembly.effects.forms` defines the functional forms and their
parameters; :mod:`forcefit.assembly.effects.functions` applies the effect.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

KINDS = ("screw", "compliance")
PLACES = ("base", "reading", "load")  # values of ``where`` in addition to frame names


@dataclass(frozen=True)
class Function:
    """General effect, given by a TOML table ``[[effect]]`` with the name ``function``.

    Attributes:
        where: a frame, ``"base"``, ``"reading"`` or ``"load"``, at which the effect
            acts.
        components: screw components ``rx`` .. ``tz`` in the axes of ``where``, or
            wrench components ``mx`` .. ``fz`` if ``where`` is ``"load"``.
        variables: one or two variables, for example ``q.drive``, ``load.fz`` or
            ``cov.temperature``.
        form: key of :data:`forcefit.assembly.effects.forms.FORMS`, or ``"formula"``.
        parameters: values by parameter name, in units that follow from the variables
            and the kind.  A parameter of one component has the component as a prefix.
        kind: ``"screw"`` [rad, m], or ``"compliance"`` [rad/(N m), m/N], which is
            multiplied by the corresponding wrench component.
        label: name used in reports.
        formula: formula, if ``form`` is ``"formula"``.
        session: session in which the effect acts; None for all sessions.
        std: known standard deviations of parameters, in the units of the parameters.
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
        """Name used in reports: the label, or ``where`` and the variables."""
        acts = f"{self.where} {', '.join(self.components)}"
        return self.label or f"{acts} of {', '.join(self.variables)}"
