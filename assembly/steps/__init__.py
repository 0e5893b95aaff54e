"""The order of assembly: bodies are located, joined and released one step at a time.

Begin at ``plan.py``, the steps as data, then ``run.py``, which carries them out.  Each
step is an equilibrium (``equilibrium.py``) that starts from the last one.
"""
