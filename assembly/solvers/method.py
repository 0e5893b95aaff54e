"""Names of the two solution methods."""

import logging
from typing import Literal, get_args

# compiled C++ code, or numpy and Clarabel only
Method = Literal["compiled", "reference"]
METHODS = get_args(Method)
_LOG = logging.getLogger("forcefit.solve")


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


def log_reference(robot: str, what: str, left: int, count: int) -> None:
    """Log that some points must be solved by the reference method.

    Args:
        robot: name of the robot.
        what: name of the computed quantity.
        left: number of points without certified solution.
        count: total number of points.
    """
    _LOG.info(
        "%s: %s of %d of %d points by the reference method, because the compiled "
        "method did not prove it", robot, what, left, count,
    )  # fmt: skip
