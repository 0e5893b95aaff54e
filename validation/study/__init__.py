"""Run the checks that a study file requests and write a single report.

Start with ``study.py``.
"""
