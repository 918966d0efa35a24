"""The compiled core, wherever it is."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

from damperfit.errors import InstallationError

if TYPE_CHECKING:
    from types import ModuleType

__all__ = ["compiled_core"]


def compiled_core() -> ModuleType:
    """Return the compiled core.

    Raises
    ------
    InstallationError
        It does not load.
    """
    try:
        core = import_module("damperfit.damper._core")
    except ImportError as error:
        installed = _installed_core()
        if installed is None:
            raise InstallationError(
                f"the compiled core does not load ({error}). "
                "Reinstall it for this Python with: pip install --force-reinstall damperfit"
            ) from error
        return installed
    return core


@lru_cache(maxsize=1)
def _installed_core() -> ModuleType | None:
    """Return the core of the installed package when a checkout without one hides that package.

    Python started in a checkout takes the sources there, after ``pip install .`` too.
    """
    import sys
    from importlib import metadata
    from importlib.machinery import PathFinder
    from importlib.util import module_from_spec
    from pathlib import Path

    from damperfit import __version__

    folders = [str(Path(entry) / "damperfit" / "damper") for entry in sys.path]
    spec = PathFinder.find_spec("damperfit.damper._core", folders)
    try:
        if spec is None or spec.loader is None or metadata.version("damperfit") != __version__:
            return None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
    except (ImportError, metadata.PackageNotFoundError):
        return None
    return module
