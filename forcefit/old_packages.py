"""Packages by their names of the last release, ``assembly`` for ``forcefit.assembly``.

Nothing is installed under the old names, so that they can hide no module of a user or
of another distribution.  They work for one more release: importing one gives the
present module and a warning, unless another module of that name is found first.
"""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from os.path import realpath
from types import ModuleType
from warnings import warn

_PACKAGES = ("stiffness", "assembly", "validation")


class OldPackages:
    """Finder and loader of Python's import: an old name leads to the present module.

    ``import forcefit`` puts it in front of ``sys.meta_path``.
    """

    def find_spec(
        self, name: str, path: object, target: object = None
    ) -> ModuleSpec | None:
        """Return the specification of an old name's module, or None for other names."""
        package, dot, _ = name.partition(".")
        if package not in _PACKAGES:
            return None
        if dot:
            ours = sys.modules.get(package) is sys.modules.get(f"forcefit.{package}")
        else:
            ours = not _is_of_others(name)
            if ours:
                _warn(name)
        return ModuleSpec(name, self) if ours else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the present module, which has its own specification already."""
        module = import_module(f"forcefit.{spec.name}")
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the module's own specification, which the import has replaced."""
        module.__spec__ = self._spec


def use_present_name(package: str) -> None:
    """Let the old name of a package lead to the present module, with a warning.

    A package calls it when it is imported by its old name, which is possible in a
    checkout only: there the folders ``assembly``, ``stiffness`` and ``validation`` are
    on the path.
    """
    sys.modules[package] = import_module(f"forcefit.{package}")
    _warn(package)


def _is_of_others(package: str) -> bool:
    """Return whether the name leads to a module that does not belong to forcefit."""
    found = PathFinder.find_spec(package)
    if found is None:
        return False
    ours = import_module(f"forcefit.{package}").__file__ or ""
    return not found.origin or realpath(found.origin) != realpath(ours)


def _warn(package: str) -> None:
    message = f"the package {package} is now forcefit.{package}"
    warn(message, FutureWarning, stacklevel=3)
