"""The two methods of every public solver, by name."""

from typing import Literal, get_args

# the C++ code of assembly/kernels, or numpy and Clarabel only
Method = Literal["compiled", "reference"]
METHODS = get_args(Method)


def check_method(method: str) -> None:
    """Reject an unknown method.

    Args:
        method: name of the method.

    Raises:
        ValueError: the method is unknown.
    """
    if method not in METHODS:
        names = " or ".join(repr(name) for name in METHODS)
        raise ValueError(f"method is {method!r}, expected {names}")
