"""Stepwise assembly: bodies are fixed, joined and released one step at a time.

``plan.py`` defines the steps, and ``run.py`` computes the results of a plan.  The state
after each step is an equilibrium (``equilibrium.py``), which depends on the state
before the step.
"""
