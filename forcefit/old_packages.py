"""Import the packages by their old names, for example ``assembly``.

Nothing is installed under the old names, because users and other distributions may
have modules with these names.  The old names are supported for one more release:
importing one returns the current module, here ``forcefit.assembly``, and emits a
warning, unless Python first finds an unrelated module with that name.
"""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from os.path import realpath
from types import ModuleType
from warnings import warn

_PACKAGES = ("stiffness", "assembly", "validation")


class OldPackages:
    """Import finder and loader that maps old package names to the current modules.

    ``import forcefit`` puts this finder at the start of ``sys.meta_path``.
    """

    def find_spec(
        self, name: str, path: object, target: object = None
    ) -> ModuleSpec | None:
        """Return the module specification for an old name, or None for other names."""
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
        """Return the current module, which already has its own specification."""
        module = import_module(f"forcefit.{spec.name}")
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the module's own specification, which the import has overwritten."""
        module.__spec__ = self._spec


def use_present_name(package: str) -> None:
    """Alias the old name of a package to the current module, and warn.

    Each package calls this function when it is imported under its old name.  This
    happens only in a checkout, where the folders ``assembly``, ``stiffness`` and
    ``validation`` are on the import path.
    """
    sys.modules[package] = import_module(f"forcefit.{package}")
    _warn(package)


def _is_of_others(package: str) -> bool:
    """Return whether the name refers to a module outside forcefit."""
    found = PathFinder.find_spec(package)
    if found is None:
        return False
    ours = import_module(f"forcefit.{package}").__file__ or ""
    return not found.origin or realpath(found.origin) != realpath(ours)


def _warn(package: str) -> None:
    message = f"the package {package} is now forcefit.{package}"
    warn(message, FutureWarning, stacklevel=3)
