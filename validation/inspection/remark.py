"""Define remarks about a campaign.

A remark has one of three levels.  ``lost`` means that no analysis can recover some
information, ``careful`` is a warning, and ``fine`` means that the design is adequate.
"""

from dataclasses import dataclass

LOST, CAREFUL, FINE = "lost", "careful", "fine"


@dataclass(frozen=True)
class Remark:
    """A remark about the design of a campaign.

    Attributes:
        about: subject of the remark.
        weight: level of the remark, ``"lost"``, ``"careful"`` or ``"fine"``.
        text: the remark as a sentence.
    """

    about: str
    weight: str
    text: str
