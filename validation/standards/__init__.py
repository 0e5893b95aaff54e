"""Accuracy and repeatability according to standards, from repeats of a campaign.

Begin with ``figures.py``.
"""
