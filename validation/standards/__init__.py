"""Accuracy and repeatability by standards, from the repeats of a campaign.

Begin with ``figures.py``.
"""
