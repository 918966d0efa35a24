"""What an earlier run may have left in a results folder and a new one must not keep.

Page and figures are drawn after the run, on request; beside new tables the old ones would tell of
other numbers. Only files with the names that damperfit gives them go.
"""

from __future__ import annotations

import re
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["FIGURES", "PAGE", "forget_figures"]

PAGE = "report.html"
FIGURES = "figures"
_DRAWN = re.compile(
    r"(mse|fan|absolute_velocity|peak_force|named_speeds|parameter_(r_m[123]|k_e|f_f|f_0)"
    r"|setting_[\w.+-]+_(force_velocity|force_displacement|force_time|residual|pressures|peaks))"
    r"\.(png|svg|pdf)"
)


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
