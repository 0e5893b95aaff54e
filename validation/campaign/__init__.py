"""Read and check measured data (campaigns).

Start with ``campaign.py``.  The format is described in ``docs/campaigns.md``.
"""
