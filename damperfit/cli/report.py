"""``damperfit report``: a results folder to one HTML page and figures, without fitting again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damperfit.cli.console import print_json, say
from damperfit.cli.option_values import check_places
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    FiguresOption,
    JsonOption,
    QuietOption,
    ResultsArgument,
    UnitsOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from damperfit.report.settings_figures import ReportPlots

__all__ = ["FIGURE_KINDS", "check_kind", "report", "write_report"]

FIGURE_KINDS = ("png", "svg", "pdf")


def report(
    results: ResultsArgument,
    figures: FiguresOption = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where to write.  [default: the results folder]"),
    ] = None,
    units: UnitsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Write report.html, one page that opens anywhere, from a results folder.

    Units are those of the run unless --units says otherwise.
    Damper and rig are those of the run; a --config is only checked.

    Example: damperfit report results --figures svg
    """
    check_kind("--figures", figures)
    if config is not None:
        from damperfit.configuration.loading import load_configuration

        load_configuration(config)
    from damperfit.tables.reading import written_of

    check_places(out)
    folder = out or written_of(results, "reports")
    remarks, files = write_report(results, folder, figures=figures, units=units)
    for remark in remarks:
        say(f"damperfit: {results}: {remark}")
    if json:
        print_json({"files": [str(path) for path in files], "remarks": list(remarks)})
    elif not quiet:
        more = f" and {len(files) - 1} figures" if len(files) > 1 else ""
        say(f"damperfit: {files[0]} written{more}")
    return 1 if remarks else 0


def check_kind(option: str, kind: str | None) -> None:
    """Refuse a kind of figure that is not known.

    Raises
    ------
    ConfigurationError
        With the kinds there are.
    """
    if kind is not None and kind not in FIGURE_KINDS:
        raise ConfigurationError(f"{option} {kind}: expected one of {', '.join(FIGURE_KINDS)}")


def write_report(
    results: Path,
    folder: Path,
    *,
    page: bool = True,
    figures: str | None = None,
    units: str | None = None,
) -> tuple[tuple[str, ...], tuple[Path, ...]]:
    """Write the page and the figures of a results folder.

    Returns
    -------
    remarks : tuple of str
        What was missing or damaged in the results.
    files : tuple of pathlib.Path
        What was written.
    """
    from damperfit.report.page import html_report
    from damperfit.report.settings_figures import report_plots
    from damperfit.results import Run
    from damperfit.store import file_set
    from damperfit.units.shown_units import parse_units

    run = Run.load(results)
    shown = report_plots(run, None if units is None else parse_units(units))
    written: list[Path] = []
    if page:
        text = html_report(shown, title=run.name)
        with file_set(folder) as files:
            files.path("report.html").write_bytes(text.encode("utf-8", "backslashreplace"))
        written.append(folder / "report.html")
    if figures is not None:
        written += _write_figures(shown, folder / "figures", kind=figures)
    return run.remarks, tuple(written)


def _write_figures(shown: ReportPlots, folder: Path, *, kind: str) -> list[Path]:
    from damperfit.report.drawing import draw_plot
    from damperfit.store import file_set

    with file_set(folder) as files:
        for plot in shown.plots:
            draw_plot(files.path(f"{plot.name}.{kind}"), plot, kind=kind)
    return [folder / f"{plot.name}.{kind}" for plot in shown.plots]
