"""A sentence on a campaign, and its importance.

A sentence is on something lost, which no analysis can recover; on something that needs
care; or on something that is as it should be.
"""

from dataclasses import dataclass

LOST, CAREFUL, FINE = "lost", "careful", "fine"


@dataclass(frozen=True)
class Remark:
    """A sentence on a campaign's design.

    Attributes:
        about: subject of the sentence.
        weight: ``"lost"``, ``"careful"`` or ``"fine"``.
        text: the sentence.
    """

    about: str
    weight: str
    text: str
