"""Reports as self-contained HTML pages, with a common layout for all types of results.

Start with :func:`forcefit.page.page.page`.  A page is composed of HTML fragments:
tables (:mod:`forcefit.page.tables`), charts and maps (:mod:`forcefit.page.charts`), and
scenes.  Numbers are stored in SI units and shown in display units
(:mod:`forcefit.results.units`).  The script ``page.js`` draws charts, sorts tables,
switches units and shows the values at a point on a click.
"""
