"""``damperfit doctor``: what works here, and the command that mends what does not."""

from __future__ import annotations

import platform
import sys
import time
from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["doctor"]

_MOST_OFF = 1e-3  # of a value that is known

# Extra, the distribution that it brings, what it is for.
_EXTRAS = (
    ("tdms", "npTDMS", "TDMS logs"),
    ("mdf", "asammdf", "MDF logs"),
    ("mat73", "h5py", "MATLAB 7.3 logs"),
    ("excel", "python-calamine", "Excel logs"),
    ("cluster", "distributed", "fleet --scheduler"),
    ("fmu", "ziglang", "FMU libraries of other platforms"),
)


@command(None, name="doctor", shown=("json", "debug", "version"))
def doctor(how: Shown) -> int:
    """Show what works on this machine: version, core, extras, a one-second fit.

    Example: damperfit doctor
    """
    python = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    found = {"damperfit": __version__, "python": python, "executable": sys.executable}
    checks = {name: _tried(check) for name, check in (("core", _core), ("fit", _fit))}
    extras = {extra: _version(name) for extra, name, _ in _EXTRAS}
    if how.json:
        results = {name: {"works": ok, "said": said} for name, (ok, said) in checks.items()}
        print_json({**found, "checks": results, "extras": extras})
    else:
        print_lines([f"{name:<10} {text}" for name, text in found.items()])
        for name, (ok, said) in checks.items():
            print_lines([f"{name:<10} {'works: ' if ok else 'FAILS: '}{said}"])
        for extra, name, purpose in _EXTRAS:
            there = extras[extra]
            said = f"{name} {there}" if there else f"not there: pip install 'damperfit[{extra}]'"
            print_lines([f"{extra:<10} {purpose}: {said}"])
    return 0 if all(ok for ok, _ in checks.values()) else 1


def _tried(check: Callable[[], str]) -> tuple[bool, str]:
    try:
        return True, check()
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what the user wants to know
        advice = "pip install --force-reinstall damperfit"
        return False, f"{type(error).__name__}: {error}; to mend it: {advice}"


def _version(distribution: str) -> str:
    """Return the version of what is installed; empty where it is not."""
    from importlib import metadata  # slow to load, and every command registers this one

    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def _core() -> str:
    from damperfit.damper import _core as core

    return str(core.__file__)


def _fit() -> str:
    """Fit a synthetic log of the reference set and compare with what it was made from."""
    from damperfit.conditioning import condition
    from damperfit.damper.purdy.parameters import PURDY_DAMPER
    from damperfit.damper.purdy.reference import reference_parameters
    from damperfit.errors import SimulationError
    from damperfit.identification import FitOptions, identify
    from damperfit.recording import Recording
    from damperfit.simulation import simulate, sine_motion
    from damperfit.tested.setting import Setting

    begun = time.perf_counter()
    truth = reference_parameters(10)
    motion = sine_motion(0.032, 1.5, cycles=5, sample_rate=1000.0)
    seen = simulate(truth, PURDY_DAMPER, motion)
    signals = (seen.time, seen.displacement, seen.force)
    log = Recording("made up", "", "", Setting.of(10), *signals)
    quantities = PURDY_DAMPER.quantities
    own = tuple(q.name for q in quantities if not q.is_shared and q.default is None)
    held = {q.name: getattr(truth, q.name) for q in quantities if q.name not in own}
    options = FitOptions(procedure="plain", free=own, fixed=held)
    (fit,) = identify([condition(log)], PURDY_DAMPER, options).fits
    adjusted = quantities[0]
    off = abs(getattr(fit.parameters, adjusted.name) / getattr(truth, adjusted.name) - 1.0)
    if off > _MOST_OFF:
        raise SimulationError(f"{adjusted.symbol} of a synthetic log is {100.0 * off:.2g} % off")
    taken = time.perf_counter() - begun
    return f"{adjusted.symbol} of a synthetic log within {100.0 * off:.1g} %, {taken:.1f} s"
