"""Read measurement campaigns and check their content.

Start with ``campaign.py``.  The file format is described in ``docs/campaigns.md``.
"""
