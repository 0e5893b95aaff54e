"""Define nonlinear joint springs of a simulated machine."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PowerLawSpring:
    """A joint spring with load = coefficient x abs(deflection)^exponent.

    Attributes:
        coefficient: [N m/rad^n or N/m^n] coefficient.
        exponent: [-] exponent n, at least 1.
    """

    coefficient: float
    exponent: float

    def secant(self, deflection: float) -> float:
        """Return the secant stiffness [N m/rad or N/m] at a deflection."""
        bent = max(abs(deflection), 1e-9)
        return float(self.coefficient * bent ** (self.exponent - 1.0))

    def under(self, load: float) -> tuple[float, float]:
        """Return the deflection [rad or m] and secant stiffness under a load."""
        deflection = (abs(load) / self.coefficient) ** (1.0 / self.exponent)
        return deflection, self.secant(deflection)


@dataclass(frozen=True)
class TwoStepSpring:
    """A joint spring with a compliance that changes at a load.

    Attributes:
        below: [rad/(N m) or m/N] compliance up to the knee.
        above: [rad/(N m) or m/N] compliance above the knee.
        knee: [N m or N] load at which the compliance changes, > 0.
    """

    below: float
    above: float
    knee: float

    def secant(self, load: float) -> float:
        """Return the secant stiffness [N m/rad or N/m] under a load."""
        size = max(abs(load), 1e-6 * self.knee)
        more = max(size - self.knee, 0.0)
        return size / (self.below * (size - more) + self.above * more)

    def under(self, load: float) -> tuple[float, float]:
        """Return the deflection [rad or m] and secant stiffness under a load."""
        stiffness = self.secant(load)
        return abs(load) / stiffness, stiffness
