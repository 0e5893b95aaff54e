"""How loops are compiled: once on each machine, by numba, which keeps them on disk.

A :func:`kernel` is called from Python; it has one signature, so that processes that
compile at once write the same.  What a kernel calls is compiled together with it, and
with every kernel that calls that one.  So only what is as short as a line of numpy is a
kernel that kernels call; all else is a :func:`part`, compiled once, by itself.

A compiled loop costs some hundredths of a second.  Assignments to slices, array
expressions and sums bring numba's broadcasting along and take several times as long to
compile as loops (:mod:`assembly.solvers.vectors`), and so does a long tuple of arrays
that is handed on where a few of them are needed.

The first compilation is announced, once, on stderr.
"""

import gc
import inspect
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache, partial
from pickle import UnpicklingError
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from llvmlite.binding import add_symbol
from numba import config, njit, types
from numba.core import event, funcdesc
from numba.core.codegen import CPUCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.core.typing import Signature
from numba.core.typing.arraydecl import GetItemBuffer, SetItemBuffer
from numba.extending import lower_builtin, type_callable

from assembly.solvers.layouts import Layout
from forcefit.native.libraries import (
    announce,
    folder_of_compiled,
    kept_beside_sources,
)

_FOLDER = folder_of_compiled()
if _FOLDER is not None and not kept_beside_sources():
    config.CACHE_DIR = str(_FOLDER)  # numba's own places cannot be written either
_OPTIONS = {"cache": _FOLDER is not None, "error_model": "numpy", "nogil": True}
_parts: dict[Callable, "_Part"] = {}
# tried first: before, each access to an array's entry tries those of some twenty other
# types, which takes a seventh of the time
for _array_access in (GetItemBuffer, SetItemBuffer):
    _array_access.metadata = {"target": "cpu"}


def kernel(function: Callable | None = None, **options: Any) -> Any:
    """Compile a function for callers in Python.

    Args:
        function: to compile, at its first call.
        options: of numba, such as ``fastmath``.

    Returns:
        The compiled function.
    """
    if function is None:
        return partial(kernel, **options)
    if config.DISABLE_JIT:  # run as Python, to be followed line by line
        return function
    compiled = njit(no_cfunc_wrapper=True, **_OPTIONS, **options)(function)
    _survive_moves(compiled)
    compile_one = compiled.compile

    def compile_with_parts(signature: Any) -> Any:
        with _without_detours():
            _load_parts(function)
            return compile_one(signature)

    # what numba calls before it compiles a function or reads it from disk
    compiled.compile = compile_with_parts
    return compiled


def part(function: Callable | None = None, **options: Any) -> Any:
    """Compile a function for kernels and other parts, which call it by name.

    Its annotations are its signature; from Python it is called uncompiled.

    Args:
        function: to compile, before the first kernel that needs it.
        options: of numba, such as ``fastmath``.

    Returns:
        The function.
    """
    if function is None:
        return partial(part, **options)
    own = _parts[function] = _Part(function, options)

    @type_callable(function)
    def type_part(context: Any) -> Callable:
        def typer(*arguments: Any) -> Signature:
            own.load()
            return own.signature

        typer.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
        return typer

    @lower_builtin(function, types.VarArg(types.Any))
    def call_part(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.call_internal(builder, own.callee, signature, arguments)

    return function


@contextmanager
def _without_detours() -> Generator[None, None, None]:
    """Compile without the garbage collector and with LLVM's module passes only.

    The collector walks through everything numba holds, again and again, a tenth of the
    time; the passes over single functions, which are to save memory, are repeated by
    those over modules.
    """
    collects, optimize = gc.isenabled(), CPUCodeLibrary._optimize_functions
    gc.disable()
    CPUCodeLibrary._optimize_functions = _keep_functions
    try:
        yield
    finally:
        CPUCodeLibrary._optimize_functions = optimize
        if collects:
            gc.enable()


def _keep_functions(library: Any, module: Any) -> None:
    """Numba's own, without the passes."""
    module.data_layout = library._codegen._data_layout


class _Part:
    """A function, its signature and its address, under a name that stays the same."""

    def __init__(self, function: Callable, options: dict[str, Any]) -> None:
        self.function, self.options, self.loaded = function, options, False

    def load(self) -> None:
        """Compile it or read it from disk, after all parts that it calls."""
        if self.loaded:
            return
        function = self.function
        _load_parts(function)
        hints = get_type_hints(function, include_extras=True)
        result = _numba_type(hints.pop("return"))
        self.signature = result(*map(_numba_type, hints.values()))
        name = f"{function.__module__}.{function.__qualname__}{self.signature}"
        self.callee = funcdesc.ExternalFunctionDescriptor(
            name, result, self.signature.args
        )
        compiled = njit(
            no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS, **self.options
        )(function)
        _survive_moves(compiled)
        compiled.compile(self.signature)
        overload = compiled.overloads[self.signature.args]
        native = overload.fndesc.llvm_func_name
        add_symbol(name, overload.library.get_pointer_to_function(native))
        self.loaded = True


def _survive_moves(compiled: Any) -> None:
    """Take what is on disk for nothing where it names what an update has moved."""
    if _FOLDER is None:
        return
    file = compiled._cache._cache_file
    load_index = file._load_index

    def load_readable() -> dict:
        try:
            return load_index()
        except (ImportError, AttributeError, EOFError, UnpicklingError):
            return {}

    file._load_index = load_readable


def _load_parts(function: Callable) -> None:
    """Load all parts that a function calls, or that kernels call that it calls."""
    for name in function.__code__.co_names:
        callee = function.__globals__.get(name)
        if isinstance(callee, Dispatcher):
            _load_parts(callee.py_func)
        elif callable(callee) and callee in _parts:
            _parts[callee].load()


@cache
def _numba_type(hint: Any) -> types.Type:
    """The numba type that an annotation says."""
    simple = {
        float: types.float64, int: types.int64, bool: types.boolean,
        type(None): types.none,
    }  # fmt: skip
    if hint in simple:
        return simple[hint]
    if get_origin(hint) is Annotated:
        layout: Layout = get_args(hint)[1]
        number = getattr(types, layout.kind)
        return types.Array(number, layout.dimensions, "C", not layout.writable)
    if get_origin(hint) is tuple:
        return types.BaseTuple.from_types(tuple(map(_numba_type, get_args(hint))))
    fields = get_type_hints(hint, include_extras=True)
    return types.BaseTuple.from_types(tuple(map(_numba_type, fields.values())), hint)


class _Announcement(event.Listener):
    """One line when the first function of this package has to be compiled."""

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"].py_func.__module__.startswith("assembly."):
            announce()

    def on_end(self, event: Any) -> None:
        """No message."""


event.register("numba:compile", _Announcement())
