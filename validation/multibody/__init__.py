"""Simulate the forced assembly in Exudyn, independently of the model.

Start with ``simulation.py``.
"""
