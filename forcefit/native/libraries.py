"""Where numba's compiled code is kept, and when callers use numba."""

import multiprocessing
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path

from forcefit.inputs.cache_folder import cache_folder, is_writable

_BESIDE = Path(__file__).with_name("__pycache__")

_alone: ContextVar[bool] = ContextVar("alone", default=False)


@contextmanager
def by_numba() -> Generator[None, None, None]:
    """Within it callers use numba."""
    token = _alone.set(True)
    try:
        yield
    finally:
        _alone.reset(token)


def numba_alone() -> bool:
    """Whether callers asked for numba, see :func:`by_numba`."""
    return _alone.get()


def folder_of_compiled() -> Path | None:
    """Where compiled code is kept: the first of these folders that can be written.

    Returns:
        ``$NUMBA_CACHE_DIR``; the folder beside this file; that of
        :func:`forcefit.inputs.cache_folder.cache_folder`; None if none can be.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given and is_writable(Path(given)):
        return Path(given)
    return _BESIDE if is_writable(_BESIDE) else cache_folder()


def kept_beside_sources() -> bool:
    """Whether compiled code is kept beside the files that it was made from."""
    return folder_of_compiled() == _BESIDE


@cache
def announce() -> None:
    """Say once that this is the first compilation on this machine."""
    if multiprocessing.parent_process() is None:
        print("forcefit: compiling, once on this machine", file=sys.stderr)
