"""Study: all checks that a study file requests, in one report.

Begin with ``study.py``.
"""
