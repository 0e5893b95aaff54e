"""Output files, each written whole or not at all.

The content is written to ``FILE.part`` beside the file, which is renamed when it is
complete and on the disk.  The remains of a killed program are overwritten by the next.
"""

import io
import json
import math
import os
import shutil
import stat
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import BadInput, quoted
from forcefit.inputs.locking import locked_file
from forcefit.inputs.packages import need


@dataclass(frozen=True)
class Kind:
    """A kind of file that commands write.

    Attributes:
        name: for messages.
        endings: that the names of its files may have.
        begins: possible first bytes of its files; letters of either case.
        packages: that write it, beyond what is always there.
    """

    name: str
    endings: tuple[str, ...]
    begins: tuple[bytes, ...]
    packages: tuple[str, ...] = ()


JSON = Kind("a JSON file", (".json",), (b"{",))
PICTURE = Kind(
    "a picture", (".png", ".svg", ".pdf"),
    (b"\x89png\r\n", b"<?xml", b"<svg", b"%pdf-"), ("matplotlib",),
)  # fmt: skip
PIXELS = Kind(
    "a picture", (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"),
    (b"\x89png\r\n", b"\xff\xd8\xff", b"bm", b"ii*\0", b"mm\0*"), ("matplotlib",),
)  # fmt: skip
PAGE = Kind("an HTML page", (".html", ".htm"), (b"<!doctype html",), ("jinja2",))
NETCDF = Kind(
    "a NetCDF file of forcefit", (".nc",), (b"\x89hdf\r\n\x1a\n",),
    ("xarray", "h5netcdf", "h5py"),
)  # fmt: skip
TABLE = Kind("a CSV table that begins with id", (".csv",), (b"id,",))
ROBOT_MARK = "# Written by forcefit."
ROBOT = Kind(
    "a robot file written by forcefit", (".toml",), (ROBOT_MARK.lower().encode(),)
)


def check_writable(path: Path | str, kind: Kind | None = None) -> None:
    """Refuse a file that could not be written, before the computation.

    Args:
        path: of a file to be written later.
        kind: of the file; an existing file must be of it.

    Raises:
        BadInput: its ending is not of the kind; its folder is absent or not writable;
            the existing file is not regular, not writable, or of another kind.
        ModuleNotFoundError: a package that writes this kind is missing.
    """
    path = Path(path)
    if kind is not None:
        need(*kind.packages)
    if kind is not None and path.suffix.lower() not in kind.endings:
        ending = f"the ending {quoted(path.suffix)}" if path.suffix else "no ending"
        expected = " or ".join(kind.endings)
        raise BadInput(f"{path}: found {ending}, expected {kind.name}: {expected}")
    folder = path.parent
    try:
        folder = Path(os.path.realpath(path)).parent
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        mode = None
    except (OSError, ValueError) as error:
        raise BadInput(unwritable(path, error)) from None
    if not folder.is_dir():
        raise BadInput(f"{path}: no folder {path.parent}; expected one that exists")
    if mode is not None:
        _check_there(path, mode, kind)
    if not os.access(folder, os.W_OK):
        raise BadInput(f"{path}: the folder {path.parent} cannot be written to")


def _check_there(path: Path, mode: int, kind: Kind | None) -> None:
    """Refuse to replace an existing file that is not writable or of another kind."""
    if stat.S_ISDIR(mode):
        raise BadInput(f"{path}: found a folder, expected a file or nothing")
    if not stat.S_ISREG(mode):
        raise BadInput(
            f"{path}: found a device, pipe or socket, expected a regular file or "
            "nothing"
        )
    if not os.access(path, os.W_OK):
        raise BadInput(f"{path}: found a file that cannot be written to")
    if kind is None or path.stat().st_size == 0:
        return
    try:
        with path.open("rb") as file:
            head = file.read(64).lower()
    except OSError as error:
        raise BadInput(unwritable(path, error)) from None
    if not head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(kind.begins):
        raise BadInput(
            f"{path}: found a file that is not {kind.name}; expected one, or nothing "
            "there: it is not overwritten"
        )


def unwritable(path: Path | str, error: Exception) -> str:
    """Return the message of a file that cannot be written, with the reason."""
    number = getattr(error, "errno", None)
    reason = os.strerror(number) if number else str(error)
    return f"{path}: cannot be written: {reason}"


@contextmanager
def whole_file(path: Path | str) -> Generator[Path, None, None]:
    """Write a file whole or not at all.

    Args:
        path: of the file; for a symbolic link, its target is written.

    Yields:
        The path to write to.  When the block ends it is renamed to the file; when it
        fails it is removed, and the file is unchanged.

    Raises:
        BadInput: the file cannot be written, as on a full disk.
    """
    path = Path(path)
    check_writable(path)
    real = Path(os.path.realpath(path))
    part = real.with_name(real.name + ".part")
    try:
        with locked_file(part):
            try:
                yield part
                with part.open("r+b") as file:  # Windows syncs what may be written
                    os.fsync(file.fileno())
                if real.exists():
                    shutil.copymode(real, part)
                part.replace(real)
            except BaseException:
                part.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise BadInput(unwritable(path, error)) from None


def check_new_folder(folder: Path | str) -> None:
    """Refuse a folder that files cannot be written to, before the work.

    Args:
        folder: new, or empty.

    Raises:
        BadInput: it holds something already, or cannot be written.
    """
    folder = Path(folder)
    check_writable(folder.parent / f"{folder.name}.new")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"{folder}: found something there, expected a new folder")


@contextmanager
def whole_folder(folder: Path | str) -> Generator[Path, None, None]:
    """A folder that appears with all its files, or not at all.

    Args:
        folder: new, or empty.

    Yields:
        Where to write its files.

    Raises:
        BadInput: it holds something already, or cannot be written.
    """
    folder = Path(folder)
    check_new_folder(folder)
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir()
        yield part
        if folder.is_dir():  # empty; Windows replaces no folder
            folder.rmdir()
        part.replace(folder)
    except OSError as error:
        raise BadInput(unwritable(folder, error)) from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def path_from(folder: Path, path: Path | str) -> str:
    """Return a path as a file of a folder names it, on every system with slashes.

    Args:
        folder: of the file.
        path: absolute, or from where the program runs.

    Returns:
        The path relative to the folder; on another drive than it, the absolute one.
    """
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return Path(path).absolute().as_posix()


def write_text(text: str, path: Path | str) -> None:
    r"""Write a text file whole or not at all.

    Args:
        text: with line ends ``\n``, written so on every system, in UTF-8.
        path: of the file.

    Raises:
        BadInput: the file cannot be written.
    """
    # names of files may hold bytes that are not UTF-8
    write_bytes(text.encode("utf-8", errors="backslashreplace"), path)


def write_bytes(content: bytes, path: Path | str) -> None:
    """Write a file whole or not at all.

    Args:
        content: of the file.
        path: of the file.

    Raises:
        BadInput: the file cannot be written.
    """
    with whole_file(path) as part:
        part.write_bytes(content)


def save_figure(figure: Any, path: Path | str) -> None:
    """Write a figure whole or not at all.

    Args:
        figure: of matplotlib.
        path: of a :data:`PICTURE`.

    Raises:
        BadInput: the ending is none of those, or the file cannot be written.
    """
    check_writable(path, PICTURE)
    content = io.BytesIO()
    with warnings.catch_warnings():  # a letter that the font lacks is drawn as a box
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(content, dpi=150, format=Path(path).suffix[1:].lower())
    write_bytes(content.getvalue(), path)


def save_pixels(pixels: Any, path: Path | str) -> None:
    """Write an RGB picture whole or not at all.

    Args:
        pixels: (rows, columns, 3) of 0 .. 255.
        path: of :data:`PIXELS`.

    Raises:
        BadInput: the ending is none of those, or the file cannot be written.
    """
    from matplotlib.image import imsave

    check_writable(path, PIXELS)
    ending = Path(path).suffix[1:].lower()
    content = io.BytesIO()
    imsave(content, pixels, format={"tif": "tiff"}.get(ending, ending))
    write_bytes(content.getvalue(), path)


def check_json(target: str | None) -> str | None:
    """Refuse a target of :func:`write_json` before the computation.

    Args:
        target: a path, ``"-"`` for standard output, None for nowhere.

    Returns:
        The target.

    Raises:
        BadInput: as :func:`check_writable`.
    """
    if target not in {None, "-"}:
        check_writable(str(target), JSON)
    return target


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
    else:
        write_text(text + "\n", target)


def plain(value: Any) -> Any:
    """Return the arrays as lists, numbers that are not finite as None, keys as text."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
