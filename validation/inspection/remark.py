"""A sentence on a campaign, and how much it matters.

It is about something lost (no analysis can bring it back), something to be careful
about, or something that is as it should be.
"""

from dataclasses import dataclass

LOST, CAREFUL, FINE = "lost", "careful", "fine"


@dataclass(frozen=True)
class Remark:
    """One sentence on a design.

    Attributes:
        about: its subject.
        weight: ``"lost"``, ``"careful"`` or ``"fine"``.
        text: the sentence.
    """

    about: str
    weight: str
    text: str
