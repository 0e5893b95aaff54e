"""Define a sentence about a campaign, and its importance.

There are three kinds of sentences: about lost information, which no analysis can
recover; about aspects that need care; and about aspects in good order.
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
