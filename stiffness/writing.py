"""Results for machines: JSON, written whole or not at all."""

import json
import math
import os
from pathlib import Path
from typing import Any

from stiffness.message import BadInput


def check_writable(path: Path) -> None:
    """Refuse a file that could not be written, before the work that leads to it.

    Args:
        path: of a file to be written later.

    Raises:
        BadInput: its folder is absent or closed to us, or it is itself a folder.
    """
    folder = path.parent
    if not folder.is_dir():
        raise BadInput(f"{path}: no folder {folder}; expected one that exists")
    if path.is_dir():
        raise BadInput(f"{path}: found a folder, expected a file or nothing")
    if not os.access(folder, os.W_OK):
        raise BadInput(f"{path}: the folder {folder} cannot be written to")


def write_json(results: dict, target: str | None) -> None:
    """Write results to a file, whole or not at all, or to standard output.

    Args:
        results: plain values; infinities and NaN become null.
        target: a path, ``"-"`` for standard output, None for nowhere.

    Raises:
        BadInput: the file cannot be written.
    """
    if target is None:
        return
    text = json.dumps(plain(results), indent=1, allow_nan=False)
    if target == "-":
        print(text)
        return
    path = Path(target)
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written: {error.strerror}") from None


def plain(value: Any) -> Any:
    """Arrays as lists, numbers that are not finite as None, keys as text."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
