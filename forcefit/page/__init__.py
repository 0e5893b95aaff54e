"""Reports: one self-contained HTML page, the same for every kind of result.

Begin with :func:`forcefit.page.page.page`.  Pieces of a page are HTML texts: tables
(:mod:`forcefit.page.tables`), charts, maps (:mod:`forcefit.page.charts`) and scenes.
Numbers are SI in the page's data and shown in the units of a drawing
(:mod:`forcefit.results.units`); ``page.js`` draws, sorts, switches units and opens
points.
"""
