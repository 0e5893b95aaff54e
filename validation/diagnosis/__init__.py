"""From measured deviations to the effect that a declared model lacks."""

from validation.diagnosis.diagnose import Diagnosis, Errors, diagnose

__all__ = ["Diagnosis", "Errors", "diagnose"]
