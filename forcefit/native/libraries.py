"""C++ of the packages, compiled where a compiler stands.

Libraries are compiled at the first use of one of them, next to each other, for this
very processor or for the one that ``FORCEFIT_MARCH`` names, and kept beside what numba
keeps.  A library's name and what it says of itself hold a digest of its source, of the
compiler's options and of the processor, so that none is used that is out of date.
Where no compiler stands, or it fails, there is no library, and callers use numba.
"""

import ctypes
import hashlib
import multiprocessing
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache, partial
from pathlib import Path

from numpy.typing import NDArray

from forcefit.inputs.cache_folder import cache_folder, is_writable
from forcefit.inputs.locking import locked_file

_ROOT = Path(__file__).parents[2]
_BESIDE = Path(__file__).with_name("__pycache__")
# lanes must not depend on each other, nor answers on how many lanes there are: nothing
# that lets sums be reordered, products and sums rounded one by one (which takes no
# longer); of what -O3 adds only whole loops undone matter to speed, and the rest takes
# a fifth longer
_OPTIONS = (
    "-std=c++17", "-O2", "-fpeel-loops", "-ffp-contract=off", "-fno-math-errno",
    "-fvisibility=hidden", "-shared", "-fPIC",
)  # fmt: skip
_COMPILERS = ("c++", "g++", "clang++")
# what nearly every command that needs one of them needs
_TOGETHER: set[str] = set()
_LONGEST = 120  # [s] a compiler may take
# what /proc/cpuinfo says of processors of one kind
_NAMED = ("vendor_id", "model name", "flags", "CPU implementer", "CPU part", "Features")


_refused: ContextVar[bool] = ContextVar("refused", default=False)


@contextmanager
def by_numba() -> Generator[None, None, None]:
    """Within it there are no libraries: callers use numba."""
    token = _refused.set(True)
    try:
        yield
    finally:
        _refused.reset(token)


def numba_alone() -> bool:
    """Whether callers asked for numba, see :func:`by_numba`."""
    return _refused.get()


def load_library(source: str) -> ctypes.CDLL | None:
    """The library of a source file, compiled before if it has to be.

    Args:
        source: file of the packages, such as ``"assembly/linear/lanes.cpp"``, that
            exports ``source_digest``.

    Returns:
        The library; None where there is no compiler, or it cannot compile it.
    """
    return None if _refused.get() else _library(source)


def library_at_hand(source: str) -> ctypes.CDLL | None:
    """The library of a source file, if it was compiled before.

    Args:
        source: as above.

    Returns:
        The library; None where it would have to be compiled now.
    """
    return None if _refused.get() else _at_hand(source)


@cache
def _at_hand(source: str) -> ctypes.CDLL | None:
    """The library that is on disk, or None, found out once."""
    digest, path = _kept_at(source)
    return _loaded(path, digest) if path is not None and path.exists() else None


@cache
def _library(source: str) -> ctypes.CDLL | None:
    """The library, or None, found out once."""
    digest, path = _kept_at(source)
    if path is None:
        return None
    library = _loaded(path, digest)
    if library is not None or path.with_suffix(".failed").exists():
        return library
    compiler = next(filter(None, map(shutil.which, _COMPILERS)), None)
    if compiler is None:
        return None
    if source in _TOGETHER:  # others take two seconds or less
        announce()
    with ThreadPoolExecutor() as pool:  # each waits for a compiler
        sources = _TOGETHER if source in _TOGETHER else {source}
        return dict(pool.map(partial(_compiled, compiler), sources))[source]


def _kept_at(source: str) -> tuple[str, Path | None]:
    """Digest and place of a library; None where nothing can be kept."""
    digest, folder = digest_of(source), folder_of_compiled()
    return digest, folder and folder / f"{Path(source).stem}.{digest}.so"


def _compiled(compiler: str, source: str) -> tuple[str, ctypes.CDLL | None]:
    """The source file, and its library if the compiler can make it."""
    digest, path = _kept_at(source)
    if path is None:
        return source, None
    lock = path.with_suffix(".lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with locked_file(lock):
            library = _loaded(path, digest)  # another program was waited for
            if library is None and not path.with_suffix(".failed").exists():
                _compile(compiler, source, digest, path)
                library = _loaded(path, digest)
            lock.unlink()
    except OSError:  # no folder to write to
        return source, None
    return source, library


def address(array: NDArray) -> int:
    """Where an array's numbers are, for C++; it must be contiguous."""
    try:  # five times as fast as what NumPy offers
        return _addressof(_buffer(array))
    except (TypeError, ValueError):  # read-only, or empty
        return array.ctypes.data


# looked up once: one call of a solver asks for fourteen
_addressof: Callable[[ctypes.c_char], int] = ctypes.addressof
_buffer: Callable[..., ctypes.c_char] = ctypes.c_char.from_buffer


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
        print(
            "forcefit: compiling its solvers, once on this machine "
            "(`forcefit warm-up` does it beforehand)",
            file=sys.stderr,
        )


def _processor() -> str:
    """Which processor this is, with all that it can do, as far as the system says."""
    features = [platform.machine()]
    with suppress(OSError):
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n")[0]
        lines = (line.partition(":") for line in first.splitlines())
        features += [text for name, _, text in lines if name.strip() in _NAMED]
    return " ".join(features)


def digest_of(source: str) -> str:
    """Digest of all that a source file's machine code depends on.

    Args:
        source: as for :func:`load_library`.

    Returns:
        16 hexadecimal digits.
    """
    parts = [" ".join(_options()), _processor()]
    package = _ROOT / Path(source).parts[0]
    for file in (_ROOT / source, *sorted(package.glob("kernels/**/*.h"))):
        parts.append(file.read_text(encoding="utf-8"))
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _options() -> tuple[str, ...]:
    """The compiler's options; an older processor's answers are had by naming it."""
    return *_OPTIONS, f"-march={os.environ.get('FORCEFIT_MARCH', 'native')}"


def _loaded(path: Path, digest: str) -> ctypes.CDLL | None:
    """What is on disk, if it is that and can be loaded."""
    try:
        library = ctypes.CDLL(str(path))
        library.source_digest.restype = ctypes.c_char_p
        return library if library.source_digest() == digest.encode() else None
    except (OSError, AttributeError):
        return None


def _compile(compiler: str, source: str, digest: str, path: Path) -> None:
    """Write the library, whole or not at all; where that fails, a note that it did."""
    handle, unfinished = tempfile.mkstemp(suffix=".so", dir=path.parent)
    os.close(handle)
    command = [
        compiler, *_options(), f'-DSOURCE_DIGEST="{digest}"', str(_ROOT / source),
        "-o", unfinished,
    ]  # fmt: skip
    try:
        subprocess.run(command, capture_output=True, timeout=_LONGEST, check=True)
        os.chmod(unfinished, 0o755)  # temporary files are their maker's alone
        os.replace(unfinished, path)
    except subprocess.SubprocessError as error:  # it refused, or took too long
        if getattr(error, "returncode", 1) > 0:  # nobody stopped it
            path.with_suffix(".failed").touch()
    finally:
        Path(unfinished).unlink(missing_ok=True)
