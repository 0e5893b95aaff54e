"""Define remarks about a campaign and their importance.

A remark has one of three levels: ``lost`` for information that no analysis can recover,
``careful`` for a warning, and ``fine`` for an adequate aspect of the design.
"""

from dataclasses import dataclass

LOST, CAREFUL, FINE = "lost", "careful", "fine"


@dataclass(frozen=True)
class Remark:
    """A remark about the design of a campaign.

    Attributes:
        about: subject of the remark.
        weight: ``"lost"``, ``"careful"`` or ``"fine"``.
        text: the remark as a sentence.
    """

    about: str
    weight: str
    text: str
