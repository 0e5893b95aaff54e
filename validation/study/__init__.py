"""Study: all checks of a study file, in one report.

Begin with ``study.py``.
"""
