"""From measured deviations to the effect that a declared model lacks."""
