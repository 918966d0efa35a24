"""``damperfit simulate``: force, velocity and pressures of one setting."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    screen_columns,
    spark_levels,
)
from damperfit.cli.option_values import (
    check_places,
    configured,
    quantity_values,
    refuse_beside,
)
from damperfit.cli.options import (
    AmplitudeOption,
    ConfigOption,
    DebugOption,
    FrequencyOption,
    JsonOption,
    MaxStepsOption,
    OverwriteOption,
    ParametersOption,
    QuietOption,
    SetOption,
    StageOption,
    TemperatureOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from damperfit.queries.one_simulation import SimulatedTest

__all__ = ["simulate"]


def simulate(
    setting: StageOption = None,
    parameters: ParametersOption = None,
    set_: SetOption = None,
    amplitude: AmplitudeOption = None,
    frequency: FrequencyOption = None,
    cycles: Annotated[
        float | None, typer.Option(metavar="N", help="Number of cycles, 1 or more.  [default: 4]")
    ] = None,
    sample_rate: Annotated[
        str | None,
        typer.Option(metavar="RATE", help="As in 1000Hz; a bare number is Hz.  [default: 1000Hz]"),
    ] = None,
    wave: Annotated[
        str | None, typer.Option(metavar="NAME", help="sine or triangle.  [default: sine]")
    ] = None,
    max_steps: MaxStepsOption = None,
    temperature: TemperatureOption = None,
    displacement: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="Drive with the displacement of a log, not a wave."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the signals: .csv or .parquet.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the loops: .png, .svg or .pdf.")
    ] = None,
    overwrite: OverwriteOption = False,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Print forces, energy and pressures of one setting.

    Example: damperfit simulate --setting 10 --amplitude 32mm --frequency 1.5Hz
    """
    from damperfit.damper.warmed import Warmed
    from damperfit.queries.chosen_parameters import choose_parameters
    from damperfit.queries.one_simulation import damper_of, simulate_test
    from damperfit.queries.rig_in_forces import notes_on_simulation
    from damperfit.results import warmed_to

    if displacement is not None:
        of_a_wave = {"--amplitude": amplitude, "--frequency": frequency, "--cycles": cycles}
        of_a_wave |= {"--sample-rate": sample_rate, "--wave": wave, "--max-steps": max_steps}
        refuse_beside("--displacement", of_a_wave, why="the log is the motion")
    given = configured(
        config,
        ("--amplitude", "rig.amplitude", amplitude),
        ("--frequency", "rig.frequency", frequency),
        ("--cycles", "simulation.cycles", cycles),
        ("--sample-rate", "simulation.sample_rate", sample_rate),
        ("--wave", "simulation.wave", wave),
        ("--max-steps", "simulation.max_steps", max_steps),
    )
    _check_suffix("--out", out, (".csv", ".parquet"))
    _check_suffix("--plot", plot, (".png", ".svg", ".pdf"))
    check_places(*(path.parent for path in (out, plot) if path is not None))
    replaced = quantity_values(set_ or [], option="--set")
    choice = choose_parameters(
        setting,
        table=parameters,
        replaced=replaced,
        folder=given.output.folder,
        damper=given.damper,
    )
    configuration, damper = damper_of(choice, given, config=config)
    configuration = warmed_to(configuration, temperature)
    if temperature is not None and isinstance(configuration.damper, Warmed):
        damper += f" Simulated at {configuration.damper.oil_temperature:g} degC."
    if displacement is not None and not displacement.exists():
        raise ConfigurationError("no such file", where=Option("displacement", displacement))
    simulated = simulate_test(choice, configuration, log=displacement)
    notes = tuple(notes_on_simulation(configuration.damper, choice.parameters))
    if not quiet:
        say(f"damperfit: {damper}")
        say(f"damperfit: {choice.source}")
        for note in (*configuration.notes, *notes):
            say(f"note: {note}")
        for warning in simulated.warnings:
            say(f"warning: {warning}")
    _write(simulated, out=out, plot=plot, spares_others=not overwrite)
    if json:
        print_json(_document(simulated, damper, notes))
    elif not quiet or out is None:
        _show(simulated)
    return 0


def _check_suffix(option: str, path: Path | None, known: tuple[str, ...]) -> None:
    if path is not None and path.suffix.lower() not in known:
        raise ConfigurationError(
            f"{option} {path}: expected a name that ends in {', '.join(known)}"
        )


def _write(
    simulated: SimulatedTest, *, out: Path | None, plot: Path | None, spares_others: bool
) -> None:
    from damperfit.store import file_set

    with ExitStack() as stack:
        sets = []
        if out is not None:
            from damperfit.tables import time_series_table, write_table

            sets.append(stack.enter_context(file_set(out.parent, spares_others=spares_others)))
            path = sets[-1].path(out.name)
            write_table(path, time_series_table(simulated.response), suffix=out.suffix)
        if plot is not None:
            from damperfit.report.drawing import draw_loops

            sets.append(stack.enter_context(file_set(plot.parent, spares_others=spares_others)))
            path, kind = sets[-1].path(plot.name), plot.suffix[1:].lower()
            draw_loops(
                path, simulated.response, simulated.frequency, kind=kind, title=_title(simulated)
            )
        for files in sets:  # both before either is exchanged
            files.spare()


def _title(simulated: SimulatedTest) -> str:
    setting = "" if simulated.choice.setting is None else f"setting {simulated.choice.setting}: "
    return setting + simulated.motion


def _show(simulated: SimulatedTest) -> None:
    from damperfit.report.forces import (
        cycle_force_sheet,
        cycle_pressure_sheet,
        cycle_sparklines,
    )

    print_lines([_title(simulated), ""])
    print_table(cycle_force_sheet(simulated.characteristics))
    if not math.isnan(simulated.characteristics.pressure_ranges[0][0]):
        print_lines([""])
        print_table(cycle_pressure_sheet(simulated.characteristics))
    cycle = cycle_sparklines(
        simulated.response, simulated.frequency, columns=screen_columns(), levels=spark_levels()
    )
    print_lines(["", "last cycle", *cycle])


def _document(simulated: SimulatedTest, damper: str, notes: tuple[str, ...]) -> Any:
    from damperfit.run.ending import json_values

    document = {
        "setting": simulated.choice.setting,
        "damper": damper,
        "notes": list(notes),
        "warnings": list(simulated.warnings),
        "source": simulated.choice.source,
        "motion": simulated.motion,
        "frequency_Hz": simulated.frequency,
        "parameters": asdict(simulated.choice.parameters),
        "characteristics": asdict(simulated.characteristics),
    }
    return json_values(document)
