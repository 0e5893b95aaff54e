"""Stepwise assembly: bodies are located, joined and released one step at a time.

Start with ``plan.py``, which defines the steps as data, then ``run.py``, which carries
them out.  Each step results in an equilibrium (``equilibrium.py``), computed from the
state after the preceding step.
"""
