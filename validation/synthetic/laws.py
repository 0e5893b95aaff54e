"""Define nonlinear laws of the joints of a simulated machine."""

from dataclasses import dataclass

from forcefit.assembly.model.robot import Clearance


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
        """Return the spring's secant stiffness [N m/rad or N/m] at a deflection."""
        bent = max(abs(deflection), 1e-9)
        return float(self.coefficient * bent ** (self.exponent - 1.0))


@dataclass(frozen=True)
class TwoStepSpring:
    """A joint spring whose compliance changes above a load.

    Attributes:
        below: [rad/(N m) or m/N] compliance below the knee.
        above: [rad/(N m) or m/N] compliance for the part of the load above the knee.
        knee: [N m or N] load at which the compliance changes, positive.
    """

    below: float
    above: float
    knee: float

    def secant(self, load: float) -> float:
        """Return the secant stiffness [N m/rad or N/m] of the spring under a load."""
        size = max(abs(load), 1e-6 * self.knee)
        more = max(size - self.knee, 0.0)
        return size / (self.below * (size - more) + self.above * more)


@dataclass(frozen=True)
class ClearanceLaw:
    """Clearance of a joint on an open chain, where the load determines the position.

    Attributes:
        clearance: bounds of the motion.
    """

    clearance: Clearance
