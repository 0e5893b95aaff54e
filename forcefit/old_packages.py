"""Old names of the packages, such as ``assembly`` for ``forcefit.assembly``.

Nothing is installed under the old names, because a user or another distribution may
have modules of these names.  The old names work for one more release.  Importing one
returns the present module and prints a warning, unless Python finds another module of
that name first.
"""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from os.path import realpath
from types import ModuleType
from warnings import warn

_PACKAGES = ("stiffness", "assembly", "validation")


class OldPackages:
    """Finder and loader for Python's import system that maps an old name to a module.

    ``import forcefit`` puts this finder at the start of ``sys.meta_path``.
    """

    def find_spec(
        self, name: str, path: object, target: object = None
    ) -> ModuleSpec | None:
        """Return the specification of a module with an old name, or None."""
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
        """Return the present module, which already has a specification."""
        module = import_module(f"forcefit.{spec.name}")
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the specification of the module, which the import has replaced."""
        module.__spec__ = self._spec


def use_present_name(package: str) -> None:
    """Make the old name of a package refer to the present module, and warn.

    A package calls this function when it is imported by its old name.  This is possible
    only in a checkout, where the folders ``assembly``, ``stiffness`` and ``validation``
    are on the import path.
    """
    sys.modules[package] = import_module(f"forcefit.{package}")
    _warn(package)


def _is_of_others(package: str) -> bool:
    """Return whether the name refers to a module that does not belong to forcefit."""
    found = PathFinder.find_spec(package)
    if found is None:
        return False
    ours = import_module(f"forcefit.{package}").__file__ or ""
    return not found.origin or realpath(found.origin) != realpath(ours)


def _warn(package: str) -> None:
    message = f"the package {package} is now forcefit.{package}"
    warn(message, FutureWarning, stacklevel=3)
