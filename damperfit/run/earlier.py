"""What an earlier run left in a results folder: what a new one must not keep, or not lose.

Page and figures are drawn after the run, on request; beside new tables the old ones would tell of
other numbers. Only files with the names that damperfit gives them go.
"""

from __future__ import annotations

import json
import re
from contextlib import suppress
from typing import TYPE_CHECKING

from damperfit.io.files import open_regular, read_bytes
from damperfit.store import file_set

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["BESIDE", "FIGURES", "PAGE", "forget_figures", "forget_others", "holds_fits"]

BESIDE = "folders_of_this_run"  # in run.json, where one command wrote results of several dampers

PAGE = "report.html"
FIGURES = "figures"
_DRAWN = re.compile(
    r"(mse|fan|absolute_velocity|peak_force|named_speeds|parameter_\w+"
    r"|setting_[\w.+-]+_(force_velocity|force_displacement|force_time|residual|pressures|peaks|valves))"
    r"\.(png|svg|pdf)"
)
_WRITTEN = re.compile(
    r"(parameters|mse|adjustment|characteristics|valves|profiles|responses)\.(csv|parquet)"
    r"|run\.json|report\.(md|html)"
)


def holds_fits(folder: Path) -> bool:
    """Whether a folder holds the results of a run that fitted something."""
    try:
        with open_regular(folder / "parameters.csv") as file:
            rows = [line for line in file.read(100_000).splitlines() if line.strip()]
    except OSError:
        return False
    return (folder / "run.json").is_file() and len(rows) > 1


def forget_others(folder: Path, written: Sequence[str]) -> None:
    """Remove what an earlier command left in a results folder: it holds one run only.

    A folder inside goes only where its run.json says that it was written as one of several
    dampers; what somebody put there by another command stays.

    Parameters
    ----------
    folder : pathlib.Path
        Where results go.
    written : sequence of str
        Folders inside of it that this command writes; "" for itself.
    """
    if "" not in written:
        _forget_run(folder)
    with suppress(OSError):
        for inside in sorted(folder.iterdir()):
            if inside.is_symlink() or inside.name in written or not _is_part(inside):
                continue
            _forget_run(inside)
            with suppress(OSError):  # what else it holds stays
                inside.rmdir()


def _is_part(folder: Path) -> bool:
    try:
        record = json.loads(read_bytes(folder / "run.json"))
    except (OSError, ValueError):
        return False
    beside = record.get(BESIDE) if isinstance(record, dict) else None
    return isinstance(beside, list) and folder.name in beside


def _forget_run(folder: Path) -> None:
    """Remove the results of a run with its figures."""
    if not (folder / "run.json").is_file():
        return
    with file_set(folder) as files:
        for path in folder.iterdir():
            if _WRITTEN.fullmatch(path.name) and path.is_file():
                files.without(path.name)
    forget_figures(folder)


def forget_figures(folder: Path) -> None:
    """Remove the figures that damperfit drew into the results folder, and their folder if empty."""
    figures = folder / FIGURES
    with suppress(OSError):  # what cannot be removed is no reason to lose the run
        if figures.is_symlink() or not figures.is_dir():
            return
        for path in figures.iterdir():
            if _DRAWN.fullmatch(path.name):
                path.unlink()
        figures.rmdir()
