"""A general effect: a small screw, or a compliance, as a function of variables.

:mod:`forcefit.assembly.effects.forms` defines its numbers;
:mod:`forcefit.assembly.effects.functions` applies it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

KINDS = ("screw", "compliance")
PLACES = ("base", "reading", "load")  # in addition to the frames of the robot


@dataclass(frozen=True)
class Function:
    """One ``[[effect]]`` named ``function`` of a robot file.

    Attributes:
        where: a frame, ``"base"``, ``"reading"`` or ``"load"``.
        components: ``rx`` .. ``tz`` of the screw there, in its axes; ``mx`` .. ``fz``
            where ``where`` is ``"load"``.
        variables: one or two, such as ``q.drive``, ``load.fz``, ``cov.temperature``.
        form: a name of :data:`forcefit.assembly.effects.forms.FORMS`, or ``"formula"``.
        parameters: numbers by name, in the units that follow from the variables and
            the kind; with several components a name may begin with one of them.
        kind: ``"screw"`` [rad, m], or ``"compliance"`` [rad/(N m), m/N]: times the
            wrench component at the same place.
        label: text for reports.
        formula: with ``form = "formula"``.
        session: the only session in which it acts; None for all.
        std: standard deviations of some parameters, in their units.
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
        """The label, or the place and the variables."""
        acts = f"{self.where} {', '.join(self.components)}"
        return self.label or f"{acts} of {', '.join(self.variables)}"
