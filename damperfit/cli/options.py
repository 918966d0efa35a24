"""The options that every command takes, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from damperfit import __version__

__all__ = [
    "AmplitudeOption",
    "ConfigOption",
    "DebugOption",
    "FiguresOption",
    "FrequencyOption",
    "GithubSummaryOption",
    "HoldOutOption",
    "JobsOption",
    "JsonOption",
    "LogFileOption",
    "LogsArgument",
    "MaxStepsOption",
    "ModelOption",
    "OverwriteOption",
    "ParametersOption",
    "ProcedureOption",
    "QuietOption",
    "ResultsArgument",
    "RigOption",
    "RigProfileOption",
    "RivalsOption",
    "SetOption",
    "SettingOption",
    "SkewOption",
    "StageOption",
    "StartOption",
    "StrictOption",
    "TestsOption",
    "ToleranceOption",
    "TruncatedOption",
    "UnitsOption",
    "VersionOption",
]


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        typer.echo(f"damperfit {__version__}")
        raise typer.Exit


ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE.toml",
        help="Damper, rig and identification.  [default: the paper's damper and test]",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else there.")
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress bar, no remarks; errors are still shown.")
]
DebugOption = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
LogFileOption = Annotated[
    Path | None,
    typer.Option(
        "--log-file",
        metavar="FILE",
        help="Append every message and step to FILE, one line each, with its time.",
    ),
]
VersionOption = Annotated[
    bool,
    typer.Option(
        "--version",
        "-V",
        help="Print the version and exit.",
        callback=_print_version,
        is_eager=True,
    ),
]
OverwriteOption = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace files of another origin that are in the way."),
]
UnitsOption = Annotated[
    str | None,
    typer.Option(
        "--units",
        metavar="LIST",
        help="Units of force, speed and length, as in N,mm/s or lbf,in/s or daN.  [default: those "
        "of the run or the configuration, else N,m/s,m]",
    ),
]
LogsArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="LOGS...", help="Log files, patterns such as 'runs/*.csv', folders, @list.txt."
    ),
]
JobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs", min=1, metavar="N", help="Workers, 1 or more.  [default: the cores available]"
    ),
]
SettingOption = Annotated[
    str | None,
    typer.Option("--setting", metavar="N", help="Setting of logs that do not give one."),
]
TestsOption = Annotated[
    Path | None,
    typer.Option(
        "--tests",
        metavar="FILE",
        help="Table of tests: file, adjusters, damper.  [default: tests.csv beside the logs]",
    ),
]
StrictOption = Annotated[
    bool, typer.Option("--strict", help="Refuse logs that have a warning; ends with code 4.")
]
CovariateOption = Annotated[
    str | None,
    typer.Option(
        "--covariate",
        metavar="temperature",
        help="Let viscous resistances follow the temperature of each log; one beta for all.",
    ),
]
TemperatureOption = Annotated[
    str | None,
    typer.Option(
        "--temperature",
        metavar="TEMP",
        help="Of the oil, as in 40degC; after identify --covariate temperature.",
    ),
]
SkewOption = Annotated[
    str | None,
    typer.Option(
        "--skew",
        metavar="TIME|auto",
        help="Delay of the force, as in 2ms, or auto to estimate it.  [default: 0s]",
    ),
]
TruncatedOption = Annotated[
    bool,
    typer.Option(
        "--allow-truncated", help="Keep the part of a truncated TDMS log that all channels have."
    ),
]
RigProfileOption = Annotated[
    str | None,
    typer.Option("--rig-profile", metavar="NAME", help="Profile of the rig for every log."),
]
RigOption = Annotated[
    list[str] | None,
    typer.Option(
        "--rig",
        metavar="KEY=VALUE",
        help="A key of [rig], such as units.force=kN; may be given several times.",
    ),
]


StartOption = Annotated[
    list[str] | None,
    typer.Option(
        "--start",
        metavar="FILE|NAME=VALUE",
        help="Where the fits start: parameters of an earlier run, or values, as in f_f=30,k_e=2e9.",
    ),
]
ModelOption = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="NAME",
        help="Model of the damper; with identify also auto, the one that the logs support.  "
        "[default: purdy]",
    ),
]
ProcedureOption = Annotated[
    str | None,
    typer.Option(
        "--procedure",
        metavar="NAME",
        help="How to fit: paper, joint, plain.  [default: paper; of other models plain]",
    ),
]
HoldOutOption = Annotated[
    list[str] | None,
    typer.Option(
        "--hold-out",
        metavar="PATTERN",
        help="Predict these logs instead of fitting them; may be given several times.  "
        "[default: transients, the run-up, coast-down and changes of speed within the logs]",
    ),
]
RivalsOption = Annotated[
    bool,
    typer.Option(
        "--rivals", help="Where the logs choose the model, also rank fourteen from the literature."
    ),
]
FiguresOption = Annotated[
    str | None,
    typer.Option(
        "--figures", "--plots", metavar="KIND", help="Write the figures as files: png, svg or pdf."
    ),
]
GithubSummaryOption = Annotated[
    bool,
    typer.Option("--github-summary", help="Append the report to the summary of the job."),
]
ToleranceOption = Annotated[
    str | None,
    typer.Option(
        "--tolerance",
        metavar="5%|20N|FILE",
        help="Band around the reference (of a fleet: the median), or a table of bands; missed: "
        "code 4.",
    ),
]
ResultsArgument = Annotated[
    Path,
    typer.Argument(metavar="RESULTS", help="Folder that identify wrote, or fleet/serial=D003."),
]
ParametersOption = Annotated[
    Path | None,
    typer.Option(
        "--parameters",
        metavar="FILE",
        help="Parameters table (.parquet, .csv) or results folder.  [default: results, if it is "
        "there, else the shipped reference set]",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Replace a parameter; may be given several times. With all five, --setting is not "
        "needed.",
    ),
]
StageOption = Annotated[
    str | None,
    typer.Option(
        "--setting",
        metavar="N",
        help="Setting whose parameters are used.",
        rich_help_panel="Damper",
    ),
]
MaxStepsOption = Annotated[
    int | None,
    typer.Option(
        "--max-steps",
        min=1,
        metavar="N",
        help="Limit on samples and integrator steps, 1 or more.  [default: 5000000]",
    ),
]
AmplitudeOption = Annotated[
    str | None,
    typer.Option(
        "--amplitude",
        metavar="LENGTH",
        help="Amplitude of the simulated motion, as in 32mm.  [default: that of the test]",
    ),
]
FrequencyOption = Annotated[
    str | None,
    typer.Option(
        "--frequency",
        metavar="FREQ",
        help="Frequency of the simulated motion, as in 1.5Hz.  [default: that of the test]",
    ),
]
