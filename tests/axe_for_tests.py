"""Accessibility of a page in a browser, by axe-core: WCAG and good practice.

A frame within a page is not read: axe-core waits for an answer of each frame, which a
frame that is loaded or removed in the meantime never gives.  The scenes that the
gallery shows in frames are read as pages of their own.
"""

from importlib.resources import files

import pytest

RUN = (
    "const done = arguments[arguments.length - 1];"
    "axe.run({resultTypes: ['violations'], iframes: false}).then(found => done("
    "found.violations.map(v => "
    "[v.impact, v.id, v.nodes.map(n => n.target.join(' '))])))"
)


def violations(tab, impacts=("serious", "critical")):
    """Rules of these impacts that a page breaks, and where; skips without axe-core."""
    pytest.importorskip("axe_core_python", reason="axe-core is absent")
    script = files("axe_core_python").joinpath("axe.min.js").read_text("utf-8")
    tab.set_script_timeout(60)
    tab.execute_script(script)
    return [one for one in tab.execute_async_script(RUN) if one[0] in impacts]


def scheme(tab, name):
    """Show a page in the light or dark colour scheme."""
    features = [{"name": "prefers-color-scheme", "value": name}]
    tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
