"""Measured data: the folder, read and checked.

Begin at ``campaign.py``; the format is ``docs/campaigns.md``.
"""
