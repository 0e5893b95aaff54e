"""Which of the two methods gives an answer: every public solver takes and says it."""

from typing import Literal, get_args

# the C++ of assembly/kernels, or numpy and Clarabel alone
Method = Literal["compiled", "reference"]


def check_method(method: str) -> None:
    """Refuse other words.

    Args:
        method: as asked.

    Raises:
        ValueError: it is neither.
    """
    if method not in get_args(Method):
        names = " or ".join(repr(name) for name in get_args(Method))
        raise ValueError(f"method is {method!r}, expected {names}")
