"""Select the compiled module for the processor at import.

For x86-64 processors, there is one module for each level of the instruction set (x86-64
psABI), with bit-identical results.  The highest level of the processor is used unless
the environment variable ``FORCEFIT_MARCH`` selects another level.  For other
processors, there is a single module.
"""

import os
import platform
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from forcefit.inputs.errors import BadInput, quoted

LEVELS = {f"x86-64-v{level}": level for level in (2, 3, 4)}
_VARIABLE = "FORCEFIT_MARCH"


def levels_here() -> list[str]:
    """Return the instruction set levels that this processor supports, lowest first.

    Returns:
        Names in :data:`LEVELS`; none for processors other than x86-64.

    Raises:
        ImportError: the compiled modules are missing.
    """
    if not _on_x86_64():
        return []
    highest = _load("_processor").level()
    return [name for name, level in LEVELS.items() if level <= highest]


def chosen() -> ModuleType:
    """Return the module for the level in ``FORCEFIT_MARCH`` or for this processor.

    Returns:
        The compiled functions.

    Raises:
        BadInput: the value of ``FORCEFIT_MARCH`` is not an instruction set level that
            this processor supports.
        ImportError: the module is missing, or the processor does not support the lowest
            level.
    """
    wanted, here = os.environ.get(_VARIABLE), levels_here()
    if wanted and wanted not in here:
        raise BadInput(
            f"{_VARIABLE} is {quoted(wanted)}; expected a level that this processor "
            f"has, {', '.join(here) or 'but it has no such levels'}"
        )
    if not _on_x86_64():
        return _load("_portable")
    if not here:
        raise ImportError("forcefit needs a processor with SSE4.2, x86-64-v2")
    return _load("_" + (wanted or here[-1]).replace("-", "_"))


def _on_x86_64() -> bool:
    """Return whether the processor is an x86-64 processor."""
    return platform.machine().lower() in {"x86_64", "amd64"}


def _load(name: str) -> ModuleType:
    """Return a compiled module of this folder."""
    full = f"{__package__}.{name}"
    if find_spec(full) is None:
        raise ImportError(
            f"{full} is not built: run `pip install -e .` in the folder of the sources"
        )
    return import_module(full)


kernels: Any = chosen()
