"""The main job: every check of a study file, one report.

Begin at ``study.py``.
"""
