"""The two loops of a simulated cycle as one figure, drawn by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.errors import InstallationError
from damperfit.report.plots.figure_files import FIXED_METADATA, fixed_style

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.simulation import Response

__all__ = ["draw_loops"]


def draw_loops(
    path: Path, response: Response, frequency: float, *, kind: str, title: str = ""
) -> None:
    """Draw force against displacement and against velocity over the last cycle.

    Parameters
    ----------
    path : pathlib.Path
        Where to write.
    response : Response
        Signals, at least one cycle.
    frequency : float
        Hz.
    kind : str
        "png", "svg" or "pdf".
    title : str
        Above both.

    Raises
    ------
    InstallationError
        matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InstallationError(
            "--plot needs matplotlib; install it with: pip install matplotlib"
        ) from error
    with fixed_style():
        figure = Figure(figsize=(10.0, 4.5), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True)
        last = response.time >= response.time[-1] - (1.0 + 1e-9) / frequency
        figure.suptitle(title, parse_math=False)
        left.plot(1e3 * response.displacement[last], response.force[last])
        left.set_xlabel("displacement, mm (positive: rebound)")
        left.set_ylabel("force, N (positive: rebound)")
        right.plot(response.velocity[last], response.force[last])
        right.set_xlabel("velocity, m/s (positive: rebound)")
        for axes in (left, right):
            axes.grid(visible=True, alpha=0.3)
        figure.savefig(path, format=kind, metadata=FIXED_METADATA[kind])
