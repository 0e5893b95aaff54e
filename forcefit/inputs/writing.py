"""Writing of output files, either completely or not at all.

The content is written to ``FILE.part`` in the same folder, and the file is renamed when
it is complete.  If a process is killed, the next one overwrites ``FILE.part``.
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
    """Type of file that commands write.

    Attributes:
        name: description for error messages, with an article.
        endings: valid file extensions.
        begins: possible first bytes of a file, in lower case; case is ignored.
        packages: optional packages required to write the file.
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
    """Check that a file can be written, before starting a long computation.

    Args:
        path: path of the file that will be written later.
        kind: type of the file, which an existing file must match.

    Raises:
        BadInput: the file extension is invalid, or the folder does not exist or is not
            writable.  This error is also raised if an existing file is not a regular
            file, is not writable, or has a different type.
        ModuleNotFoundError: a package required to write the file is missing.
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
        raise BadInput(
            f"{path}: found no folder {path.parent}; expected an existing folder"
        )
    if mode is not None:
        _check_there(path, mode, kind)
    if not os.access(folder, os.W_OK):
        raise BadInput(f"{path}: the folder {path.parent} cannot be written to")


def _check_there(path: Path, mode: int, kind: Kind | None) -> None:
    """Check that an existing file is writable and has the expected type."""
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
            f"{path}: found a file that is not {kind.name}; it is not overwritten, "
            "write to a different file"
        )


def unwritable(path: Path | str, error: Exception) -> str:
    """Compose the message for a file that cannot be written, with the reason."""
    number = getattr(error, "errno", None)
    reason = os.strerror(number) if number else str(error)
    return f"{path}: cannot be written: {reason}"


@contextmanager
def whole_file(path: Path | str) -> Generator[Path, None, None]:
    """Write a file completely or not at all.

    Args:
        path: path of the file; for a symbolic link, the target is written.

    Yields:
        Temporary path to write to.  At the end of the block, the written file is
        renamed to ``path``.  After an error, it is removed, and an existing file at
        ``path`` stays unchanged.

    Raises:
        BadInput: the file cannot be written, for example because the disk is full.
    """
    path = Path(path)
    check_writable(path)
    real = Path(os.path.realpath(path))
    part = real.with_name(real.name + ".part")
    try:
        with locked_file(part):
            try:
                yield part
                with part.open("r+b") as file:  # Windows allows fsync only if writable
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
    """Check that a folder can be written, before starting a long computation.

    Args:
        folder: path of a new or empty folder.

    Raises:
        BadInput: the folder is not empty or cannot be written.
    """
    folder = Path(folder)
    check_writable(folder.parent / f"{folder.name}.new")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(
            f"{folder}: found a file or a folder that is not empty, expected a new "
            "folder"
        )


@contextmanager
def whole_folder(folder: Path | str) -> Generator[Path, None, None]:
    """Write a folder with all its files completely or not at all.

    Args:
        folder: path of a new or empty folder.

    Yields:
        Temporary folder to which the block must write the files.

    Raises:
        BadInput: the folder is not empty or cannot be written.
    """
    folder = Path(folder)
    check_new_folder(folder)
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir()
        yield part
        if folder.is_dir():  # Windows cannot replace a folder, even an empty one
            folder.rmdir()
        part.replace(folder)
    except OSError as error:
        raise BadInput(unwritable(folder, error)) from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def path_from(folder: Path, path: Path | str) -> str:
    """Return a path relative to a folder, with slashes on every operating system.

    Args:
        folder: folder that contains the file in which the path will be stored.
        path: absolute path, or path relative to the working directory.

    Returns:
        Path relative to the folder, or the absolute path if it is on a different drive.
    """
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return Path(path).absolute().as_posix()


def write_text(text: str, path: Path | str) -> None:
    r"""Write a text file completely or not at all.

    Args:
        text: text with line endings ``\n``, which are preserved; encoded as UTF-8.
        path: path of the file.

    Raises:
        BadInput: the file cannot be written.
    """
    # file names in the text may contain bytes that are not valid UTF-8
    write_bytes(text.encode("utf-8", errors="backslashreplace"), path)


def write_bytes(content: bytes, path: Path | str) -> None:
    """Write a file completely or not at all.

    Args:
        content: bytes of the file.
        path: path of the file.

    Raises:
        BadInput: the file cannot be written.
    """
    with whole_file(path) as part:
        part.write_bytes(content)


def save_figure(figure: Any, path: Path | str) -> None:
    """Write a figure completely or not at all.

    Args:
        figure: matplotlib figure.
        path: path with a file extension of :data:`PICTURE`.

    Raises:
        BadInput: the file extension is invalid, or the file cannot be written.
    """
    check_writable(path, PICTURE)
    content = io.BytesIO()
    # matplotlib warns and draws a box for characters missing from the font
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(content, dpi=150, format=Path(path).suffix[1:].lower())
    write_bytes(content.getvalue(), path)


def save_pixels(pixels: Any, path: Path | str) -> None:
    """Write an RGB picture completely or not at all.

    Args:
        pixels: array (rows, columns, 3) of values from 0 to 255.
        path: path with a file extension of :data:`PIXELS`.

    Raises:
        BadInput: the file extension is invalid, or the file cannot be written.
    """
    from matplotlib.image import imsave

    check_writable(path, PIXELS)
    ending = Path(path).suffix[1:].lower()
    content = io.BytesIO()
    imsave(content, pixels, format={"tif": "tiff"}.get(ending, ending))
    write_bytes(content.getvalue(), path)


def check_json(target: str | None) -> str | None:
    """Check that the JSON output can be written, before starting a long computation.

    Args:
        target: a path, ``"-"`` for standard output, or None for no output.

    Returns:
        The target.

    Raises:
        BadInput: the file cannot be written; see :func:`check_writable`.
    """
    if target not in {None, "-"}:
        check_writable(str(target), JSON)
    return target


def write_json(results: dict, target: str | None) -> None:
    """Write results as JSON to a file, completely or not at all, or to standard output.

    Args:
        results: plain values or arrays; infinities and NaN become null.
        target: a path, ``"-"`` for standard output, or None for no output.

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
    """Convert a value for JSON: arrays become lists, infinities and NaN become None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
