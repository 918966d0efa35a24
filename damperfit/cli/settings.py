"""``damperfit settings``: force by setting and click, and the setting that gives a force."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    say_lines,
    screen_columns,
)
from damperfit.cli.option_values import configured, rig_entries
from damperfit.cli.options import (
    AmplitudeOption,
    ConfigOption,
    DebugOption,
    FrequencyOption,
    JobsOption,
    JsonOption,
    QuietOption,
    RigOption,
    RigProfileOption,
    TemperatureOption,
    UnitsOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.adjustment import Answer, Wanted
    from damperfit.io import ReadOptions
    from damperfit.queries.adjuster_results import AdjusterResults
    from damperfit.queries.force_by_setting import ForcesBySetting, Question
    from damperfit.report.sheet import Sheet
    from damperfit.units.shown_units import ShownUnits

__all__ = ["settings"]


def settings(
    results: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RESULTS",
            help="Folder that identify wrote, or files of measured curves.  [default: results]",
        ),
    ] = None,
    force: Annotated[
        str | None,
        typer.Option(metavar="FORCE", help="Which setting gives it? As in 900N; minus: bump."),
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(metavar="SPEED", help="At this speed, as in 0.2m/s; minus: bump."),
    ] = None,
    stroke: Annotated[
        str | None, typer.Option(metavar="NAME", help="rebound or bump, instead of a sign.")
    ] = None,
    amplitude: AmplitudeOption = None,
    frequency: FrequencyOption = None,
    temperature: TemperatureOption = None,
    rig: RigOption = None,
    rig_profile: RigProfileOption = None,
    units: UnitsOption = None,
    jobs: JobsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Show force by setting and what a click changes; find the setting for a force.

    Example: damperfit settings --force 900N --velocity 0.2m/s
    """
    from damperfit.queries.adjuster_results import read_adjuster_results
    from damperfit.queries.force_by_setting import parse_question, tabulate_forces
    from damperfit.units.shown_units import SI, parse_units
    from damperfit.workers import available_cores

    shown = SI if units is None else parse_units(units)
    question = parse_question(force=force, velocity=velocity, stroke=stroke)
    paths = results or [Path("results")]
    if all(path.is_file() for path in paths):
        without_effect = {
            "--amplitude": amplitude,
            "--frequency": frequency,
            "--temperature": temperature,
            "--units": units,
        }
        for option, value in without_effect.items():
            if value is not None:
                raise ConfigurationError(
                    f"{option} {value} has no effect: the forces of {paths[0]} were measured, not "
                    "simulated; leave it out"
                )
        profile = ("--rig-profile", "rig.profile", rig_profile)
        reading = configured(config, *rig_entries(rig), profile, is_law_open=True).reading
        return _curves(paths, question, reading, is_json=json, is_quiet=quiet)
    folder = _one_folder(paths)
    for option, given in (("--rig", rig[0] if rig else None), ("--rig-profile", rig_profile)):
        if given is not None:
            raise ConfigurationError(
                f"{option} {given} has no effect: {folder} holds results, and no log is read; "
                "leave it out"
            )
    adjuster = read_adjuster_results(
        folder, config=config, amplitude=amplitude, frequency=frequency, temperature=temperature
    )
    forces = tabulate_forces(adjuster, question, jobs=jobs or available_cores())
    remarks = (*adjuster.remarks, *forces.remarks)
    for remark in remarks:
        say(f"damperfit: {folder}: {remark}")
    for trace in forces.traces if debug else ():
        say_lines(trace)
    for note in forces.notes:
        say(f"note: {note}")
    if json:
        print_json(_document(adjuster, question, forces, remarks))
    else:
        _show(adjuster, question, forces, units=shown, is_quiet=quiet)
    return 1 if remarks else 0


def _one_folder(paths: Sequence[Path]) -> Path:
    """Return the results folder that was given, where that is all."""
    if len(paths) > 1:
        raise ConfigurationError(
            f"found {', '.join(map(str, paths[:3]))}; expected one results folder, or files of "
            "measured curves alone"
        )
    return paths[0]


def _curves(
    paths: Sequence[Path],
    question: Question,
    reading: ReadOptions,
    *,
    is_json: bool,
    is_quiet: bool,
) -> int:
    """Answer from curves that were measured without time."""
    from damperfit.queries.measured_forces import measured_forces
    from damperfit.report.forces import curve_forces_sheet
    from damperfit.report.records import to_record
    from damperfit.run.ending import json_values

    found = measured_forces(paths, question, reading=reading)
    if is_json:
        asked = None if question.force is None else to_record(question)
        document = {
            "source": ", ".join(map(str, paths)),
            "question": asked,
            "sentence": found.sentence or None,
        }
        print_json(json_values(document | {"forces": found.rows()}))
        return 0
    if found.sentence:
        print_lines(wrap(found.sentence, screen_columns()))
        if is_quiet:
            return 0
        print_lines([""])
    for note in () if is_quiet else dict.fromkeys(n for one in found.curves for n in one.notes):
        say(f"note: {note}")
    sheet = curve_forces_sheet(found.curves, found.speeds[-5:])
    print_table(sheet)
    return 0


def _show(
    adjuster: AdjusterResults,
    question: Question,
    forces: ForcesBySetting,
    *,
    units: ShownUnits,
    is_quiet: bool,
) -> None:
    from damperfit.report.forces import (
        force_by_setting_sheet,
        force_sheets,
        measured_force_sheet,
    )
    from damperfit.report.units import rows_in_units, sheet_in_units
    from damperfit.tables import adjustment_rows

    def shown(sheet: Sheet) -> Sheet:
        return sheet_in_units(sheet, units)

    if forces.wanted:
        if is_quiet:
            print_lines([one.said_in(units) for one in forces.wanted])
            return
        print_lines(
            [part for one in forces.wanted for part in wrap(one.said_in(units), screen_columns())]
            + [""]
        )
    rows = rows_in_units(adjustment_rows(forces.levels, forces.clicks), units)
    print_lines([f"force by setting, {units.say_lengths(adjuster.source)}", ""])
    if question.speed is not None:
        both = question.stroke is None or question.force is not None
        strokes = ("rebound", "bump") if both else (question.stroke or "",)
        print_table(shown(force_by_setting_sheet(rows, strokes)))
        measured = measured_force_sheet(rows)
        if measured.rows:
            print_lines([""])
            print_table(shown(measured))
        return
    for sheet in force_sheets(rows, (question.stroke,) if question.stroke else ("rebound", "bump")):
        print_table(shown(sheet))
        print_lines([""])
    measured = measured_force_sheet(rows)
    if measured.rows:
        print_table(shown(measured))


def _answer(wanted: Wanted, answer: Answer) -> dict[str, Any]:
    from damperfit.report.records import to_record

    along = {"adjuster": wanted.adjuster, "held": wanted.held} if wanted.held else {}
    record: dict[str, Any] = to_record(answer)
    return record | along


def _document(
    adjuster: AdjusterResults, question: Question, forces: ForcesBySetting, remarks: tuple[str, ...]
) -> dict[str, Any]:
    from damperfit.report.records import to_record
    from damperfit.run.ending import json_values
    from damperfit.tables import adjustment_rows

    wanted = forces.wanted
    sine = adjuster.sine
    document: dict[str, Any] = json_values(
        {
            "motion": {"amplitude_m": sine.amplitude, "frequency_Hz": sine.frequency},
            "source": adjuster.source,
            "question": to_record(question) if wanted else None,
            "sentence": "; ".join(one.sentence for one in wanted) or None,
            "answers": [_answer(one, answer) for one in wanted for answer in one.answers],
            "forces": adjustment_rows(forces.levels, forces.clicks),
            "remarks": list(remarks),
            "notes": list(forces.notes),
        }
    )
    return document
