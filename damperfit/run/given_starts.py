"""Where fits start, as a user has said it: --start FILE and --start NAME=VALUE."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from damperfit.configuration.options import Configuration, parameter_value
from damperfit.damper.model import FRICTION, GAS_AMOUNT, OFFSET, STIFFNESS
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.network import BLOW_OFFS, Valve
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.identification.options import GivenStart, check_start
from damperfit.problem import Option
from damperfit.tables.files import read_known_numbers
from damperfit.tested.setting import Setting

# What dampers of every kind have: a table without more is of another model.
_EVERYWHERE = frozenset({OFFSET, FRICTION, STIFFNESS, GAS_AMOUNT})


def with_given_start(configuration: Configuration) -> Configuration:
    """Return the configuration with the parameters of the earlier run that it names as a start."""
    path = configuration.start_table
    damper, options = configuration.damper, configuration.identification
    if path is None or options.start.by_setting:  # the latter from the choice of a law
        return configuration
    earlier = _read(path)
    named = {name for numbers in earlier.values() for name in numbers}
    if not named & {q.name for q in damper.quantities if q.role not in _EVERYWHERE}:
        raise ConfigurationError(
            f"its parameters ({', '.join(sorted(named))}) belong to another model "
            f"than {damper.name} ({', '.join(damper.names)}); name that model by "
            "{--model}, or give {start}",
            start=Option("start", "VALUE", "NAME"),
            where=Option("start", path),
            code="other-model",
        )
    own = {
        setting: {name: value for name, value in numbers.items() if name in damper.names}
        for setting, numbers in earlier.items()
    }
    start = replace(options.start, by_setting=own)
    return replace(configuration, identification=replace(options, start=start))


def start_of_laws(configuration: Configuration, named: Mapping[str, str]) -> GivenStart:
    """Return a start for laws that are only to be chosen; it may name what any of them has.

    ``named`` are NAME=VALUE as typed; the configuration's table of an earlier run counts too.
    """
    mounting = Mounting(FIT, FIT, FIT)
    valves = [Valve("long", kind) for kind in BLOW_OFFS if kind != "none"]
    kinds = (TwinTube, Monotube, ThroughFlow)
    laws = [kind(rebound=v, compression=v, mounting=mounting) for kind in kinds for v in valves]
    models = (configuration.damper, *laws)
    quantities = {quantity.name: quantity for model in models for quantity in model.quantities}
    numbers: dict[str, float] = dict(configuration.identification.start.named)
    for name, text in named.items():
        if name not in quantities:
            raise ConfigurationError(
                f"no law has a parameter {name!r}; there are "
                f"{', '.join(quantities)}.{did_you_mean(name, quantities)}",
                where=Option("start", text, name),
                code="unknown-quantity",
            )
        try:
            numbers[name] = parameter_value(quantities[name], text)
            check_start(quantities[name], numbers[name], is_fixed=False, is_held=False)
        except ConfigurationError as error:
            raise error.at(Option("start")) from error
    path = configuration.start_table
    return GivenStart(numbers, {} if path is None else _read(path))


def _read(path: Path) -> dict[Setting, dict[str, float]]:
    table = path / "parameters.parquet" if path.is_dir() else path
    try:
        earlier = read_known_numbers(table)
    except ConfigurationError as error:
        raise ConfigurationError(
            "{problem}; expected parameters that identify wrote, or NAME=VALUE",
            problem=error.at(Option("start")),
            code="no-start",
        ) from error
    if not earlier:
        raise ConfigurationError(
            "its rows contain no parameter to start from",
            where=Option("start", table),
            code="no-start",
        )
    return earlier
