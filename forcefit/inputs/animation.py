"""Writing of animations as GIF files, completely or not at all."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from forcefit.inputs.writing import Kind, check_writable, write_bytes

# pillow, which writes GIF, is a requirement of matplotlib
ANIMATION = Kind("an animation", (".gif",), (b"gif8",), ("matplotlib",))
_COLOURS = 64  # number of colours that all pictures share


def save_animation(pictures: Iterable[tuple[Any, int]], path: Path | str) -> None:
    """Write an animation that repeats, completely or not at all.

    Args:
        pictures: each (rows, columns, 3) values from 0 to 255, and its duration [ms].
        path: path with an ending of :data:`ANIMATION`.

    Raises:
        BadInput: the ending is not valid, or the file cannot be written.
    """
    from PIL import Image

    check_writable(path, ANIMATION)
    images, durations = [], []
    for pixels, duration in pictures:
        image = Image.fromarray(pixels)
        images.append(image.quantize(_COLOURS, dither=Image.Dither.NONE))
        durations.append(duration)
    content = io.BytesIO()
    images[0].save(
        content, format="GIF", save_all=True, append_images=images[1:],
        duration=durations, loop=0, optimize=True,
    )  # fmt: skip
    write_bytes(content.getvalue(), path)
