"""Figures of a machine as standards define them, from the repeats of a campaign.

Begin at ``figures.py``.
"""
