"""What a call or a command line asks for: keywords, as values or as text, to a configuration."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError
from damperfit.keywords import PYTHON_ONLY, keyword_of
from damperfit.problem import Option
from damperfit.wrong_calls import is_typed, path_of, spelled

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.tested.setting import Setting

__all__ = [
    "assignments",
    "configured",
    "covaried",
    "declared_setting",
    "known_as_setting",
    "names_given",
    "refuse_beside",
    "refuse_idle",
    "rig_keys",
    "starts_of",
    "values_given",
    "workers",
]

_ASSIGNMENT = re.compile(r"\s*[A-Za-z_]\w*\s*=")
_NEXT_ASSIGNMENT = re.compile(r",(?=\s*[A-Za-z_]\w*\s*=)")


def configured(
    command: str,
    given: Mapping[str, Any],
    *more: tuple[str, str, Any],
    is_law_open: bool = False,
) -> Configuration:
    """Return the configuration that keywords ask for.

    Parameters
    ----------
    command : str
        Whose keywords these are.
    given : mapping of str to any
        By keyword; what is None, or a flag that is not set, is not given.
    *more : tuple of str, str and any
        A keyword, the key that it sets, as in "identification.start", and the value, where the
        keyword's own value is not what the key has.
    is_law_open : bool
        The logs choose the law.

    Raises
    ------
    ConfigurationError
        A key or value is wrong; the keyword or option is named.
    """
    from damperfit.configuration.loading import load_configuration

    call = f"damperfit.{command}"
    sections: dict[str, dict[str, Any]] = {}
    options: dict[str, Option] = {}

    def put(place: str, value: Any, name: Option) -> None:
        section, _, key = place.partition(".")
        sections.setdefault(section, {})[key] = value
        options[place] = name

    if given.get("damper") is not None:
        sections["damper"] = _declared(given["damper"], call)
    units = given.get("units")
    for keyword, value in given.items():
        if value is None or value is False or keyword in PYTHON_ONLY:
            continue
        known = keyword_of(command, keyword)
        if known.key:
            put(known.key, _parsed(known.kind, value, call, keyword), Option(keyword))
    for keyword, place, value in more:
        if value is not None:
            put(place, value, Option(keyword))
    for key, value in rig_keys(given.get("rig"), call).items():
        put(f"rig.{key}", value, Option("rig", key=key))
    if isinstance(units, str):
        from damperfit.units.shown_units import parse_units

        parse_units(units)
        put("output.units", units, Option("units"))
    elif units is not None:
        _mapping(call, "units", units)
        put("rig.units", {**sections.get("rig", {}).get("units", {}), **units},
            Option("units"))  # fmt: skip
    config = given.get("config")
    if config is not None:
        config = path_of(config, f"{call}(config=...)", "the path of a TOML file")
    try:
        return load_configuration(
            config, overlay=sections, options=options, is_law_open=is_law_open
        )
    except ConfigurationError as error:
        if is_typed() or error.problem.where is not None:
            raise
        raise ConfigurationError("{problem}", problem=error, subject=call) from error


def _parsed(kind: str, value: Any, call: str, keyword: str) -> Any:
    """Return a keyword's value as its key has it."""
    if kind in {"names", "quantities"}:
        names = names_given(value, call, keyword)
        return [name.lower() for name in names] if kind == "quantities" else names
    if kind == "values":
        return values_given(value, call, keyword) or None
    if kind == "texts":
        return _listed(value, call, keyword)
    if kind == "path":
        return str(path_of(value, spelled(call, keyword), "the path of a table of tests"))
    return value


def _declared(damper: Any, call: str) -> dict[str, Any]:
    from damperfit.damper.model import Model

    if isinstance(damper, Model):
        model: Any = damper
        return {"model": model.name, **asdict(model)}
    if isinstance(damper, Mapping):
        _mapping(call, "damper", damper)
        return dict(damper)
    found = f"the class {damper.__name__}" if isinstance(damper, type) else type(damper).__name__
    raise ConfigurationError(
        f"{call}(damper=...): found {found}; expected a damper such as "
        "damperfit.Damper(rod_diameter=0.012), or keys of [damper]"
    )


def _mapping(call: str, keyword: str, value: object) -> None:
    if not isinstance(value, Mapping):
        found = repr(value) if isinstance(value, str | float | list) else type(value).__name__
        raise ConfigurationError(
            f"{call}({keyword}=...): found {found}; expected a mapping of names to values"
        )
    for name in value:
        if not isinstance(name, str):
            raise ConfigurationError(
                f"{call}({keyword}=...): found {name!r} in place of a name; expected a mapping of "
                "names to values"
            )


def _listed(values: object, call: str, keyword: str) -> list[Any]:
    if isinstance(values, str):
        return [values]
    if not isinstance(values, Iterable):
        raise ConfigurationError(
            f"{call}({keyword}=...): found {values!r}; expected a list of names"
        )
    return list(values)


def names_given(names: Iterable[str] | str, call: str, keyword: str) -> list[str]:
    """Return names given as a list, as text with commas, or as a list of such.

    Raises
    ------
    ConfigurationError
        They are neither.
    """
    return [part.strip() for text in _listed(names, call, keyword) for part in str(text).split(",")]


def values_given(values: Any, call: str, keyword: str) -> dict[str, str]:
    """Return values by quantity: of a mapping, or of NAME=VALUE texts and lists; K_e is k_e.

    Raises
    ------
    ConfigurationError
        They are neither, or a name is given twice.
    """
    if values is None:
        return {}
    if is_typed():
        lower = (
            f"{name.lower()}{equals}{value}"
            for text in values
            for name, equals, value in (one.partition("=") for one in _NEXT_ASSIGNMENT.split(text))
        )
        return assignments(lower, option=spelled(call, keyword))
    _mapping(call, keyword, values)
    return {name: str(value) for name, value in values.items()}


def assignments(
    texts: Iterable[str], *, option: str, example: str = "k_e=5e8", may_be_empty: bool = False
) -> dict[str, str]:
    """Return NAME=VALUE texts as a dictionary.

    Raises
    ------
    ConfigurationError
        A text has no name, no ``=`` or no value (unless it may be empty), or a name is given twice.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and (value or may_be_empty)):
            raise ConfigurationError(f"{option} {text}: expected NAME=VALUE, such as {example}")
        if name in values:
            raise ConfigurationError(f"{option} {text}: {name} is given twice")
        values[name] = value
    return values


def rig_keys(given: Any, call: str = "") -> dict[str, Any]:
    """Return keys of [rig]: of a mapping, or of KEY=VALUE texts, whose KEY may be dotted.

    A value is what it would be in TOML; what is no TOML (kN, or nothing) is text.

    Raises
    ------
    ConfigurationError
        A text has no key or no ``=``, or a key is given twice.
    """
    if given is None:
        return {}
    if not isinstance(given, list | tuple):
        _mapping(call, "rig", given)
        return dict(given)
    import json
    import tomllib

    keys: dict[str, Any] = {}
    texts = assignments(given, option="--rig", example="units.force=kN", may_be_empty=True)
    for key, value in texts.items():
        for text in (value, json.dumps(value)):
            with suppress(tomllib.TOMLDecodeError):
                found = tomllib.loads(f"{key} = {text}")
                break
        else:
            raise ConfigurationError(f"{key!r} is not a key", where=Option("rig", value, key))
        for name, entry in found.items():
            is_table = isinstance(entry, dict) and isinstance(keys.get(name), dict)
            keys[name] = keys[name] | entry if is_table else entry
    return keys


def starts_of(given: Any) -> tuple[str | None, dict[str, str]]:
    """Return the file and the values that ``start`` gives, values one by one or in lists.

    Examples
    --------
    >>> starts_of(["results", "f_f=30,k_e=2e9"])
    ('results', {'f_f': '30', 'k_e': '2e9'})
    >>> starts_of({"f_f": 30})
    (None, {'f_f': '30'})

    Raises
    ------
    ConfigurationError
        Two files are given, a value is missing, or a name is given twice.
    """
    if isinstance(given, Mapping):
        return None, {str(name): str(value) for name, value in given.items()}
    texts = [str(given)] if isinstance(given, str | Path) else [str(one) for one in given or []]
    parts = [part for text in texts for part in _parted(text)]
    values = [part for part in parts if _ASSIGNMENT.match(part) and not _is_there(part)]
    files = [part for part in parts if part not in values]
    if len(files) > 1:
        raise ConfigurationError(
            f"{files[0]} is given already; a fit starts from one earlier run",
            where=Option("start", files[1]),
        )
    if "" in files:
        raise ConfigurationError(
            "expected a file or NAME=VALUE, such as k_e=5e8", where=Option("start", "''")
        )
    pairs = (one.partition("=") for text in values for one in _NEXT_ASSIGNMENT.split(text))
    lower = (f"{name.lower()}{equals}{value}" for name, equals, value in pairs)
    return (files[0] if files else None), assignments(lower, option="--start")


def _parted(text: str) -> list[str]:
    return [text] if _is_there(text) else _NEXT_ASSIGNMENT.split(text)


def _is_there(text: str) -> bool:
    """Whether a text names a file; a list of values may be longer than any name."""
    with suppress(OSError, ValueError):
        return Path(text).exists()
    return False


def covaried(command: str, given: Mapping[str, Any], *, of_fleet: bool = False) -> Any:
    """Return the reference temperature that ``covariate="temperature"`` asks for.

    One that the configuration file names stays. Otherwise it is the mean of the logs, and of a
    fleet, whose dampers are held beside each other, the nominal temperature of the test.

    Raises
    ------
    ConfigurationError
        Another word, a law is to be chosen too, or the file cannot be read.
    """
    word, model = given.get("covariate"), given.get("model")
    if word is None:
        return None
    if word != "temperature":
        raise ConfigurationError(
            "expected temperature, the only one there is", where=Option("covariate", word)
        )
    if model == "auto":
        raise ConfigurationError(
            "choose the law first, from logs of one temperature (damperfit models), then name it: "
            "{model}",
            model=Option("model", "NAME"),
            where=Option("covariate", "temperature"),
        )
    asked = {name: given.get(name) for name in ("config", "damper", "model")}
    configuration = configured(command, asked)
    named: str | float = configuration.document["damper"]["reference_temperature"]
    if named != "none":
        return named
    return configuration.rig.temperature if of_fleet else "mean"


def workers(jobs: Any, call: str) -> int:
    """Return how many workers are asked for; None: as many as there are cores.

    Raises
    ------
    ConfigurationError
        It is no whole number above 0.
    """
    if jobs is None:
        from damperfit.workers import available_cores

        return available_cores()
    if type(jobs) is bool or not isinstance(jobs, Integral) or int(jobs) < 1:
        raise ConfigurationError(
            f"{call}(jobs=...): found {jobs!r}; expected a whole number above 0"
        )
    return int(jobs)


def declared_setting(setting: Any, configuration: Configuration) -> Setting | None:
    """Return the setting that is meant, by its label or number.

    Raises
    ------
    ConfigurationError
        It is none.
    """
    from damperfit.tested.setting import Setting, parse_setting

    setting = known_as_setting(setting, "setting=...")
    if setting is None or isinstance(setting, Setting):
        return setting
    try:
        return parse_setting(str(setting), configuration.reading.adjusters)
    except ValueError as error:
        told = setting if is_typed() else repr(setting)
        raise ConfigurationError(f"{error}", where=Option("setting", told)) from error


def known_as_setting(setting: Any, call: str) -> Setting | int | str | None:
    """Return a setting as it was given: its number, its label, or itself.

    Raises
    ------
    ConfigurationError
        It is nothing of the kind.
    """
    from damperfit.tested.setting import Setting

    if setting is None or isinstance(setting, Setting | str):
        return setting
    is_yes_or_no = isinstance(setting, bool)
    if isinstance(setting, Real) and not is_yes_or_no:
        number = float(setting)
        return int(number) if number.is_integer() else str(number)
    raise ConfigurationError(
        f"found {type(setting).__name__}; expected a setting such as 10 or 'R12 C8'", subject=call
    )


def refuse_beside(option: str, others: Mapping[str, Any], *, why: str) -> None:
    """Refuse what cannot be combined with another option.

    Raises
    ------
    ConfigurationError
        One of the others was given.
    """
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise ConfigurationError(
            f"{given[0]} cannot be combined with {option}: {why}; leave one of the two out"
        )


def refuse_idle(given: Mapping[str, Any], names: Sequence[str], why: str) -> None:
    """Refuse what would have no effect.

    Raises
    ------
    ConfigurationError
        One of the names was given.
    """
    for name in names:
        value = given.get(name)
        if value is None:
            continue
        said = value[0] if isinstance(value, list) and value else value
        option = f"--{name.replace('_', '-')}"
        raise ConfigurationError(f"{option} {said} has no effect: {why}; leave it out")
