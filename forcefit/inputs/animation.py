"""Writing of GIF animations, completely or not at all."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from forcefit.inputs.writing import Kind, check_writable, write_bytes

# pillow, which writes the GIF, is installed with matplotlib
ANIMATION = Kind("an animation", (".gif",), (b"gif8",), ("matplotlib",))
_COLOURS = 64  # size of the colour palette of each frame


def save_animation(pictures: Iterable[tuple[Any, int]], path: Path | str) -> None:
    """Write a looping animation, completely or not at all.

    Args:
        pictures: for each frame, an array (rows, columns, 3) of values from 0 to 255
            and the duration [ms].
        path: path with a file extension of :data:`ANIMATION`.

    Raises:
        BadInput: the file extension is invalid, or the file cannot be written.
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
