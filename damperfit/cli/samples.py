"""``damperfit samples``: make-believe rig logs with known parameters."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damperfit.cli.console import print_json, print_lines, say
from damperfit.cli.option_values import check_places, configured
from damperfit.cli.options import ConfigOption, DebugOption, JsonOption, QuietOption, VersionOption
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Values

__all__ = ["samples"]

_MOST = 1000  # settings; more is a slip of the keyboard


def samples(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the logs.")],
    settings: Annotated[
        str, typer.Option(metavar="LIST", help="Settings to make, as in 1,5,10-12.")
    ] = "1-20",
    parameters: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="True values, with damper and motion: parameters table (.parquet, .csv) or "
            "results folder.  [default: the shipped reference set]",
        ),
    ] = None,
    cycles: Annotated[float, typer.Option(metavar="N", help="Cycles in a log.")] = 15.0,
    sample_rate: Annotated[
        str, typer.Option(metavar="RATE", help="Samples per second, as in 1000Hz.")
    ] = "500Hz",
    force_noise: Annotated[
        str, typer.Option(metavar="FORCE", help="Sensor noise of the force, rms.")
    ] = "4N",
    displacement_noise: Annotated[
        str, typer.Option(metavar="LENGTH", help="Sensor noise of the displacement, rms.")
    ] = "8um",
    rig_filter: Annotated[
        str, typer.Option(metavar="FREQ", help="Corner of a filter in the rig; 0: no filter.")
    ] = "0Hz",
    seed: Annotated[
        int, typer.Option(metavar="N", help="Of the noise; same seed, same logs.")
    ] = 2000,
    model: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Model of the damper.  [default: purdy]"),
    ] = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Write make-believe rig logs with known parameters.

    Example: damperfit samples my_runs --settings 1-5
    """
    from damperfit.cli.progress import progress
    from damperfit.samples import SampleOptions, make_samples
    from damperfit.units.quantities import parse_quantity

    check_places(folder)
    loaded = configured(config, ("--model", "damper.model", model))
    truth, damper = None, loaded.damper_sentence
    if parameters is not None:
        truth, loaded, damper = _truth(parameters, loaded, config)
    try:
        options = SampleOptions(
            settings=_numbers(settings),
            cycles=cycles,
            sample_rate=parse_quantity(sample_rate, "frequency", option="--sample-rate"),
            amplitude=loaded.rig.amplitude,
            frequency=loaded.rig.frequency,
            force_noise=parse_quantity(force_noise, "force", option="--force-noise"),
            displacement_noise=parse_quantity(
                displacement_noise, "length", option="--displacement-noise"
            ),
            rig_filter=parse_quantity(rig_filter, "frequency", option="--rig-filter"),
            seed=seed,
            damper=loaded.damper,
        )
    except ConfigurationError as error:
        raise ConfigurationError(_as_typed(str(error))) from error
    with progress(is_wanted=not quiet) as bar:
        bar.start(len(options.settings))
        logs = make_samples(folder, options, parameters=truth, on_log=bar.advance)
    if not quiet:
        say(f"damperfit: {damper}")
    written = [*(str(log) for log in logs), str(folder / "truth.csv"), str(folder / "README.md")]
    if json:
        print_json({"logs": [str(log) for log in logs], "files": written})
    elif not quiet:
        print_lines(written)
    return 0


def _truth(
    given: Path, configuration: Configuration, config: Path | None
) -> tuple[dict[int, Values], Configuration, str]:
    """Return the values of a table, and the configuration and line of the damper they hold for."""
    from damperfit.queries.chosen_parameters import table_meant
    from damperfit.queries.origin import damper_of_table
    from damperfit.results import Run

    path = table_meant(given)
    meant, damper = damper_of_table(path, configuration, config=config)
    known = {one.setting.cell: one.values for one in Run.load(path).settings}
    truth = {setting: values for setting, values in known.items() if isinstance(setting, int)}
    return truth, meant, damper


def _as_typed(said: str) -> str:
    """Return what options make no log, by the options of the command line.

    Examples
    --------
    >>> _as_typed("samples: force_noise is -1.0; expected 0 or more")
    '--force-noise -1.0: expected 0 or more'
    """
    told = re.fullmatch(r"samples: (\w+) is (.+); (expected .+)", said)
    if told is None:
        return said
    name = told[1].replace("_", "-")
    is_of_rig = told[1] in {"amplitude", "frequency"}
    return f"{f'rig.{name} =' if is_of_rig else f'--{name}'} {told[2]}: {told[3]}"


def _numbers(text: str) -> tuple[int, ...]:
    """Return the settings that a list such as ``1,5,10-12`` names."""
    try:
        numbers: list[int] = []
        for part in text.split(","):
            first, _, last = part.strip().partition("-")
            numbers.extend(range(int(first), min(int(last or first), int(first) + _MOST) + 1))
    except ValueError:
        numbers = []
    if not 0 < len(numbers) <= _MOST:
        raise ConfigurationError(
            "expected a list such as 1,5,10-12", where=Option("settings", text)
        )
    return tuple(dict.fromkeys(numbers))
