"""Define a sentence about a campaign, and its importance.

The importance has three levels.  ``lost``: information that no analysis can recover.
``careful``: an aspect of the campaign that needs care.  ``fine``: an aspect in good
order.
"""

from dataclasses import dataclass

LOST, CAREFUL, FINE = "lost", "careful", "fine"


@dataclass(frozen=True)
class Remark:
    """A sentence about a campaign's design.

    Attributes:
        about: subject of the sentence.
        weight: ``"lost"``, ``"careful"`` or ``"fine"``.
        text: the sentence.
    """

    about: str
    weight: str
    text: str
