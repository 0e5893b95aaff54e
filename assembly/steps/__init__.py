"""Assembly in steps: bodies are located, joined and released one step at a time.

Start with ``plan.py``, which defines the steps as data, then ``run.py``, which carries
them out.  The result of each step is an equilibrium (``equilibrium.py``) that starts
from the state after the preceding step.
"""
