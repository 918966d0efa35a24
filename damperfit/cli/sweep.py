"""``damperfit sweep``: what one parameter does to the force (the paper's Figs 4-9)."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import print_json, print_lines, print_table, say, screen_columns
from damperfit.cli.option_values import check_places, configured, quantity_values
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    FiguresOption,
    JsonOption,
    MaxStepsOption,
    OverwriteOption,
    ParametersOption,
    QuietOption,
    SetOption,
    StageOption,
    VersionOption,
)
from damperfit.cli.report import check_kind
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.queries.chosen_parameters import ChosenParameters
    from damperfit.queries.sweep import Variation
    from damperfit.report.figures import Plot
    from damperfit.report.forces import SweepMember

__all__ = ["sweep"]


def sweep(
    setting: StageOption = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=F1,F2",
            help="Scale by these factors: r_m1 r_m2 r_m3 k_e f_f f_0 p_0 gamma amplitude "
            "frequency.",
        ),
    ] = None,
    paper: Annotated[
        bool,
        typer.Option(
            "--paper",
            help="Figures 4 to 9 of the paper, at setting 10 unless --setting says otherwise.",
        ),
    ] = False,
    parameters: ParametersOption = None,
    set_: SetOption = None,
    max_steps: MaxStepsOption = None,
    figures: FiguresOption = "png",
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for table and figures.")] = Path(
        "sweep"
    ),
    overwrite: OverwriteOption = False,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Scale one parameter by factors and show what it does to the force.

    Example: damperfit sweep --setting 10 --vary r_m1=0.8,1,1.2
    """
    from damperfit.queries.chosen_parameters import choose_parameters
    from damperfit.queries.one_simulation import damper_of
    from damperfit.queries.sweep import PAPER_SWEEPS, parse_variation

    check_kind("--figures", figures)
    if not vary and not paper:
        raise ConfigurationError("nothing to vary: give --vary NAME=F1,F2,... or --paper")
    check_places(out)
    given = configured(config, ("--max-steps", "simulation.max_steps", max_steps))
    replaced = quantity_values(set_ or [], option="--set")
    number = "10" if paper and setting is None else setting
    choice = choose_parameters(
        number, table=parameters, replaced=replaced, folder=given.output.folder, damper=given.damper
    )
    configuration, damper = damper_of(choice, given, config=config)
    variations = [parse_variation(text, configuration.damper) for text in vary or []]
    if len({variation.name for variation in variations}) < len(variations):
        raise ConfigurationError(
            "a name is given twice; put its factors into one list", where=Option("vary")
        )
    if paper and configuration.damper.name != "purdy":
        raise ConfigurationError(
            f"the figures are of the paper's model; these parameters are of "
            f"{configuration.damper.name!r}: give --vary NAME=F1,F2,...",
            where=Option("paper"),
        )
    if not quiet:
        say(f"damperfit: {damper}")
        say(f"damperfit: {choice.source}")
        for note in configuration.notes:
            say(f"note: {note}")
    wanted = [(v, False) for v in variations] + [(v, True) for v in PAPER_SWEEPS if paper]
    sweeps = [(v, _members(choice, configuration, v), is_paper) for v, is_paper in wanted]
    if not quiet:
        fastest = max(_peak_speed(one) for _, members, _ in sweeps for one in members)
        for warning in choice.warnings(fastest, getattr(configuration.damper, "temperature", None)):
            say(f"warning: {warning}")
    records, plots = _lay_out(sweeps)
    _write(out, records, plots, kind=figures or "png", spares_others=not overwrite)
    if json:
        sentences = [_sentence(variation, members) for variation, members, _ in sweeps]
        facts = {"damper": damper, "source": choice.source}
        print_json(facts | {"rows": records, "sentences": sentences})
    else:
        for variation, members, _ in sweeps:
            _show(variation, members, configuration)
    if not quiet:
        figures = f"{len(plots)} figure{'s' * (len(plots) > 1)}"
        say(f"damperfit: sweep.csv and {figures} written to {out}")
    return 0


def _members(
    choice: ChosenParameters, configuration: Configuration, variation: Variation
) -> tuple[SweepMember, ...]:
    from damperfit.queries.sweep import run_sweep
    from damperfit.report.forces import SweepMember

    return tuple(
        SweepMember(
            member.factor,
            member.value,
            member.simulated.frequency,
            member.simulated.response,
            member.simulated.characteristics,
        )
        for member in run_sweep(choice, configuration, variation=variation)
    )


def _peak_speed(member: SweepMember) -> float:
    velocity = member.response.velocity
    return float(max(velocity.max(), -velocity.min()))


def _sentence(variation: Variation, members: Sequence[SweepMember]) -> str:
    from damperfit.report.forces import sweep_sentence

    return sweep_sentence(variation.name, members)


def _lay_out(
    sweeps: Sequence[tuple[Variation, Sequence[SweepMember], bool]],
) -> tuple[list[dict[str, Any]], list[Plot]]:
    from damperfit.damper.purdy.figures import FAMILIES
    from damperfit.report.forces import sweep_records
    from damperfit.report.log_figures import sweep_plot, sweep_pressure_plot

    records: list[dict[str, Any]] = []
    plots = []
    known = {one.name: one for one in FAMILIES}
    for variation, members, is_paper in sweeps:
        name = variation.name
        records += sweep_records(name, members)
        number = known[name].number if is_paper else 0
        of_pressures = known[name].of_pressures if is_paper else 0
        file_name = f"figure_{number}_{name}" if number else f"sweep_{name}"
        title = f"Force against velocity, {name} varied"
        plots.append(sweep_plot(name, members, file_name=file_name, title=title))
        worst = max(members, key=lambda member: member.cavitation)
        if worst.cavitation > 0.0 or of_pressures:
            first = f"figure_{of_pressures or 7}" if number else "sweep"
            file_name = f"{first}_{name}_pressures"
            title = f"Chamber pressures, {name} x{worst.factor:g}"
            plots.append(sweep_pressure_plot(worst, file_name=file_name, title=title))
    return records, plots


def _write(
    folder: Path,
    records: Sequence[dict[str, Any]],
    plots: Sequence[Plot],
    *,
    kind: str,
    spares_others: bool,
) -> None:
    import csv

    from damperfit.report.drawing import draw_plot
    from damperfit.store import file_set

    with file_set(folder, spares_others=spares_others) as files:
        for plot in plots:
            draw_plot(files.path(f"{plot.name}.{kind}"), plot, kind=kind)
        with files.path("sweep.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(records[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(records)


def _show(
    variation: Variation, members: Sequence[SweepMember], configuration: Configuration
) -> None:
    from damperfit.queries.sweep import swept_units
    from damperfit.report.forces import sweep_sheet

    sheet = sweep_sheet(variation.name, swept_units(configuration.damper)[variation.name], members)
    print_table(sheet)
    print_lines([*wrap(_sentence(variation, members), screen_columns()), ""])
