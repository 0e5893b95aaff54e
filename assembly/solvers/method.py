"""Which of the two methods gives an answer: every public solver takes and says it."""

from typing import Literal, get_args

# the C++ of assembly/kernels, or numpy and Clarabel alone
Method = Literal["compiled", "reference"]
METHODS = get_args(Method)


def check_method(method: str) -> None:
    """Refuse other words.

    Args:
        method: as asked.

    Raises:
        ValueError: it is neither.
    """
    if method not in METHODS:
        names = " or ".join(repr(name) for name in METHODS)
        raise ValueError(f"method is {method!r}, expected {names}")
