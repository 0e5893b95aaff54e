"""Determine which effects can be detected with the design of a campaign.

Start with ``inspection.py``.
"""
