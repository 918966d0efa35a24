"""The compiled core, wherever it is."""

import sys
from functools import lru_cache
from importlib import import_module
from types import ModuleType

from damperfit.errors import InstallationError

_NAME = "damperfit.damper._core"


def compiled_core() -> ModuleType:
    """Return the compiled core."""
    try:
        return import_module(_NAME)
    except ImportError as error:
        installed = _installed_core()
        if installed is None:
            raise InstallationError(
                f"the compiled core does not load ({error}). "
                "Reinstall it for this Python with: pip install --force-reinstall damperfit",
                code="core",
            ) from error
        return installed


@lru_cache(maxsize=1)
def _installed_core() -> ModuleType | None:
    """Return the core of the installed package when a checkout without one hides that package.

    Python started in a checkout takes the sources there, after ``pip install .`` too.
    """
    from importlib import metadata
    from importlib.machinery import PathFinder
    from importlib.util import module_from_spec
    from pathlib import Path

    from damperfit import __version__

    folders = [str(Path(entry) / "damperfit" / "damper") for entry in sys.path]
    spec = PathFinder.find_spec(_NAME, folders)
    try:
        if spec is None or spec.loader is None or metadata.version("damperfit") != __version__:
            return None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
    except (ImportError, metadata.PackageNotFoundError):
        return None
    return module
