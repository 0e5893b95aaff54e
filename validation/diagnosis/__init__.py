"""Identify the effects that make a machine differ from its model.

Start with ``diagnose.py``, which selects effects and learns functions.  ``judge.py``
determines the verdict, and ``diagnosis.py`` defines the result.
"""
