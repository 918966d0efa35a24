"""The compiled core, wherever it is, and what its endings mean."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

from damperfit.errors import InstallationError

if TYPE_CHECKING:
    from types import ModuleType

    from damperfit.simulation.motion import Motion
    from damperfit.simulation.response import SolverOptions

__all__ = ["compiled_core", "describe_ending"]

_ENDINGS = {
    1: "the state or the displacement is not a finite number",
    2: "the integrator needs more than {limit} steps between two samples",
    3: "the stroke leaves no volume in a chamber or in the gas",
    4: "a parameter or a solver option is zero, negative or not finite",
}


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


def describe_ending(code: int, sample: int, motion: Motion, options: SolverOptions) -> str:
    """Return the sentence of a simulation that ended with a code other than 0, at a sample."""
    what = _ENDINGS[code].format(limit=options.max_steps_per_sample)
    if sample >= len(motion.displacement):
        return f"simulation failed: {what}."
    moment = motion.start_time + sample * motion.interval
    x = motion.displacement[sample]
    return f"simulation failed at sample {sample} ({moment:.6g} s, x = {x:.6g} m): {what}."
