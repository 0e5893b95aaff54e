"""Check the accessibility of a page in a browser with axe-core.

Frames within a page are not checked, because axe-core may wait forever for a frame that
is loaded or removed during the check.  The scenes that the gallery shows in frames are
checked as separate pages.
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
    """Return the violated rules of a page; skip the test if axe-core is missing."""
    pytest.importorskip("axe_core_python", reason="axe-core is absent")
    script = files("axe_core_python").joinpath("axe.min.js").read_text("utf-8")
    tab.set_script_timeout(60)
    tab.execute_script(script)
    return [one for one in tab.execute_async_script(RUN) if one[0] in impacts]


def scheme(tab, name):
    """Show a page in the light or dark colour scheme."""
    features = [{"name": "prefers-color-scheme", "value": name}]
    tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
