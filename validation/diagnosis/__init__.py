"""Identify the effects that cause the difference between a machine and its model.

Start with ``diagnose.py``, which selects effects and learns functions.  ``judge.py``
determines the verdict.  ``diagnosis.py`` defines the result.
"""
