"""Reading and checking of measured data (campaigns).

Begin at ``campaign.py``; the format is ``docs/campaigns.md``.
"""
