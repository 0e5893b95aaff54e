"""Run all checks that a study file requests, and write one report.

Start with ``study.py``.
"""
