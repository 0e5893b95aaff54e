"""Read measurement campaigns and check their content.

Start with ``campaign.py``. The page ``docs/campaigns.md`` describes the file format.
"""
