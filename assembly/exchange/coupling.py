"""Couplings, which make one joint coordinate a polynomial of another coordinate."""

from collections.abc import Sequence
from dataclasses import dataclass

from forcefit.inputs.errors import BadInput, quoted


@dataclass(frozen=True)
class Coupling:
    """Coupled joint: q = rest + sum of c_k (q_leader - leader_rest)^k.

    Attributes:
        follower: name of the coupled joint.
        leader: name of the joint that determines its coordinate; None if the follower
            is fixed.
        coefficients: coefficients c_0, c_1, ...
        rest: rest coordinate of the follower [rad or m].
        leader_rest: rest coordinate of the leader [rad or m].
    """

    follower: str
    leader: str | None
    coefficients: tuple[float, ...]
    rest: float = 0.0
    leader_rest: float = 0.0

    def at(self, leader: float) -> tuple[float, float]:
        """Return the follower's coordinate and its derivative.

        The derivative is with respect to the leader's coordinate.
        """
        x = leader - self.leader_rest
        value = slope = 0.0
        for c in reversed(self.coefficients):
            slope = slope * x + value
            value = value * x + c
        return self.rest + value, slope

    def text(self) -> str:
        """Return the equation of the coupling as text."""
        c = [*self.coefficients, 0.0, 0.0]
        if self.leader is None:
            return f"{self.follower} = {self.rest + c[0]:g}"
        if not any(c[2:]):
            offset = self.rest + c[0] - c[1] * self.leader_rest
            return f"{self.follower} = {c[1]:g} * {self.leader} + {offset:g}"
        terms = [f"{v:g} * x^{k}" for k, v in enumerate(c) if v and k]
        shift = f" - {self.leader_rest:g}" if self.leader_rest else ""
        sum_of_terms = " + ".join([f"{self.rest + c[0]:g}", *terms])
        return f"{self.follower} = {sum_of_terms}, x = {self.leader}{shift}"


def leaders_first(couplings: Sequence[Coupling], file: str) -> tuple[Coupling, ...]:
    """Sort couplings such that each leader is computed before its followers.

    Args:
        couplings: couplings in any order.
        file: name of the file, for error messages.

    Returns:
        The sorted couplings.

    Raises:
        BadInput: a joint follows two joints, itself, or one of its followers.
    """
    of: dict[str, Coupling] = {}
    for coupling in couplings:
        if coupling.follower in of:
            raise BadInput(
                f"{file}: joint {quoted(coupling.follower)}: found two "
                "couplings in which it follows another joint, expected one; "
                "remove one of them"
            )
        of[coupling.follower] = coupling
    order: list[Coupling] = []
    for first in couplings:
        path: list[Coupling] = []
        one: Coupling | None = first
        while one is not None and one not in order:
            if one in path:
                ring = " -> ".join(quoted(c.follower) for c in path)
                raise BadInput(
                    f"{file}: joint {quoted(one.follower)}: found a cycle of "
                    f"couplings in which it follows itself ({ring}), expected "
                    "it to follow another joint"
                )
            path.append(one)
            one = of.get(one.leader or "")
        order += reversed(path)
    return tuple(order)
