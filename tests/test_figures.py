"""The static figures against golden images and texts, and that a wrong curve would be seen."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.legend import Legend
from matplotlib.testing.compare import calculate_rms
from PIL import Image

from damperfit.reporting.drawing import compose, fixed_style
from damperfit.reporting.figures import report_plots
from damperfit.reporting.plots import CHAMBER_COLOURS, Line, Plot, setting_colours, setting_panel
from damperfit.results import Run
from tests.report_folder import make_results

GOLDEN = Path(__file__).parent / "golden" / "figures"
DPI = 60
# Other hinting of letters gives 0, no simplification of paths 0.3, a loop 3 % off 9.
TOLERANCE = 1.0
IS_WRITING = bool(os.environ.get("DAMPERFIT_WRITE_GOLDEN"))
NAMES = (
    "parameter_k_e",
    "mse",
    "fan",
    "named_speeds",
    "setting_02_force_velocity",
    "setting_02_force_time",
    "setting_02_residual",
    "setting_03_pressures",
)


@pytest.fixture(scope="module")
def plots(tmp_path_factory):
    folder = make_results(tmp_path_factory.mktemp("results"))
    return {plot.name: plot for plot in report_plots(Run.load(folder)).plots}


def pixels(path: Path) -> np.ndarray:
    """Return the image averaged over squares of 3 pixels, shape (h, w, 3)."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB").reduce(3), dtype=float)


def curves(plot: Plot, path: Path) -> None:
    """Draw a plot without its letters."""
    with fixed_style():
        figure = compose(plot, dpi=DPI)
        figure.set_layout_engine("none")
        for axes in figure.axes:
            axes.set_title("", loc="left")
            axes.tick_params(labelbottom=False, labelleft=False, which="both")
            axes.set(xlabel="", ylabel="")
            for text in [*axes.texts, *axes.findobj(Legend)]:
                text.remove()
        figure.savefig(path, format="png", dpi=DPI, metadata={"Software": None})


def difference(plot: Plot, golden: Path, folder: Path) -> float:
    path = folder / golden.name
    curves(plot, path)
    if IS_WRITING:
        golden.parent.mkdir(exist_ok=True)
        golden.write_bytes(path.read_bytes())
    return float(calculate_rms(pixels(golden), pixels(path)))


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_is_as_agreed(plots, name, tmp_path):
    assert difference(plots[name], GOLDEN / f"{name}.png", tmp_path) < TOLERANCE


def test_every_style_is_drawn_as_agreed(tmp_path):
    """What the folder of the tests lacks: a trend with a band, rings."""
    x = np.arange(1.0, 7.0)
    colours = setting_colours(range(1, 7))
    band = Line(x, x**2, "trend", "muted", style="dashed", low=0.8 * x**2, high=1.2 * x**2)
    styles = ("points", "triangles", "rings", "points")
    points = tuple(
        Line(x[k : k + 1], x[k : k + 1] ** 2, style, colours[k + 1], k + 1, style, False)
        for k, style in enumerate(styles)
    )
    panel = setting_panel(range(1, 7), "R", "N", (band, *points))
    chambers = tuple(
        Line(x, x + i, f"chamber {i}", colour, style="solid")
        for i, colour in enumerate(CHAMBER_COLOURS)
    )
    for name, lines in (("styles", panel.lines), ("bands", chambers)):
        one = replace(panel, lines=lines, bands=((2.0, 3.0),) if name == "bands" else ())
        plot = Plot(name, name, (one,))
        assert difference(plot, GOLDEN / f"{name}.png", tmp_path) < TOLERANCE
