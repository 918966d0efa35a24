"""What options say, from text to values: assignments, names, settings, the configuration."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.tested.setting import Setting

__all__ = [
    "assignments",
    "check_places",
    "configured",
    "covaried",
    "declared_setting",
    "names_of",
    "quantity_names",
    "quantity_values",
    "refuse_beside",
    "refuse_what_cannot_act",
    "rig_entries",
    "starts_of",
    "with_typed_option",
]

_UNWRITTEN = "cannot write to "
_ASSIGNMENT = re.compile(r"\s*[A-Za-z_]\w*\s*=")
_NEXT_ASSIGNMENT = re.compile(r",(?=\s*[A-Za-z_]\w*\s*=)")


def starts_of(texts: Sequence[str] | None) -> tuple[str | None, dict[str, str]]:
    """Return the file and the values that ``--start`` gives, values one by one or in lists.

    Examples
    --------
    >>> starts_of(["results", "f_f=30,k_e=2e9"])
    ('results', {'f_f': '30', 'k_e': '2e9'})

    Raises
    ------
    ConfigurationError
        Two files are given, a value is missing, or a name is given twice.
    """
    parts = [part for text in texts or [] for part in _parted(text)]
    values = [part for part in parts if _ASSIGNMENT.match(part) and not _is_there(part)]
    files = [part for part in parts if part not in values]
    if len(files) > 1:
        raise ConfigurationError(
            f"--start {files[1]}: {files[0]} is given already; a fit starts from one earlier run"
        )
    if "" in files:
        raise ConfigurationError("--start '': expected a file or NAME=VALUE, such as k_e=5e8")
    return (files[0] if files else None), quantity_values(values, option="--start")


def _parted(text: str) -> list[str]:
    return [text] if _is_there(text) else _NEXT_ASSIGNMENT.split(text)


def _is_there(text: str) -> bool:
    """Whether a text names a file; a list of values may be longer than any name."""
    with suppress(OSError, ValueError):
        return Path(text).exists()
    return False


def quantity_values(texts: Iterable[str], *, option: str) -> dict[str, str]:
    """Return NAME=VALUE texts, or lists of them, by quantity; K_e is k_e.

    Raises
    ------
    ConfigurationError
        As of `assignments`.

    Examples
    --------
    >>> quantity_values(["K_e=2e9, f_f=30", "f_0=0"], option="--fix")
    {'k_e': '2e9', 'f_f': '30', 'f_0': '0'}
    """
    lower = (
        f"{name.lower()}{equals}{value}"
        for text in texts
        for name, equals, value in (one.partition("=") for one in _NEXT_ASSIGNMENT.split(text))
    )
    return assignments(lower, option=option)


def quantity_names(texts: Iterable[str] | None) -> list[str] | None:
    """Return the quantities that options name, None where none was given.

    Examples
    --------
    >>> quantity_names(["R_m1, k_e", "f_f"]), quantity_names(None)
    (['r_m1', 'k_e', 'f_f'], None)
    """
    return None if texts is None else [name.lower() for name in names_of(texts)]


def refuse_what_cannot_act(
    configuration: Configuration, share: list[str] | None, *, is_law_open: bool, rivals: bool
) -> None:
    """Refuse what `identify` would be asked for in vain, before a log is read.

    Raises
    ------
    ConfigurationError
        Parameters are shared by another procedure than joint, or freed where the law is open, or
        models are to be ranked where it is not.
    """
    procedure = configuration.identification.procedure
    if share is not None and procedure != "joint":
        raise ConfigurationError(
            f"--share {','.join(share)} has no effect: only procedure joint fits shared "
            f"parameters, found procedure {procedure}; add --procedure joint"
        )
    if is_law_open and configuration.identification.free:
        raise ConfigurationError(
            "--free has no effect: with --model auto the logs choose what is fitted; hold a "
            "parameter with --fix, or name the model"
        )
    if rivals and not is_law_open:
        raise ConfigurationError(
            "models are ranked where the logs choose the law; add --model auto, or ask "
            "damperfit models LOGS --rivals",
            where=Option("rivals"),
        )


def rig_entries(texts: Iterable[str] | None) -> list[tuple[str, str, Any]]:
    """Return KEY=VALUE texts as entries of [rig] for `configured`; KEY may be dotted.

    A value is what it would be in TOML; what is no TOML (kN, or nothing) is text.

    Raises
    ------
    ConfigurationError
        A text has no key or no ``=``, or a key is given twice.
    """
    import json
    import tomllib

    keys: dict[str, Any] = {}
    given = assignments(texts or [], option="--rig", example="units.force=kN", may_be_empty=True)
    for key, value in given.items():
        for text in (value, json.dumps(value)):
            with suppress(tomllib.TOMLDecodeError):
                found = tomllib.loads(f"{key} = {text}")
                break
        else:
            raise ConfigurationError(f"{key!r} is not a key", where=Option("rig", value, key))
        for name, entry in found.items():
            is_table = isinstance(entry, dict) and isinstance(keys.get(name), dict)
            keys[name] = keys[name] | entry if is_table else entry
    return [(f"--rig {name}", f"rig.{name}", entry) for name, entry in keys.items()]


def covaried(
    word: str | None, *, model: str | None, config: Path | None = None, of_fleet: bool = False
) -> str | float | None:
    """Return the reference temperature that ``--covariate temperature`` asks for.

    One that the configuration file names stays. Otherwise it is the mean of the logs, and of a
    fleet, whose dampers are held beside each other, the nominal temperature of the test.

    Raises
    ------
    ConfigurationError
        Another word, a law is to be chosen too, or the file cannot be read.
    """
    if word is None:
        return None
    if word != "temperature":
        raise ConfigurationError(
            "expected temperature, the only one there is", where=Option("covariate", word)
        )
    if model == "auto":
        raise ConfigurationError(
            "choose the law first, from logs of one temperature "
            "(damperfit models), then name it: --model NAME",
            where=Option("covariate", "temperature"),
        )
    overlay = [] if model is None else [("--model", "damper.model", model)]
    configuration = configured(config, *overlay)
    named: str | float = configuration.document["damper"]["reference_temperature"]
    if named != "none":
        return named
    return configuration.rig.temperature if of_fleet else "mean"


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


def names_of(texts: Iterable[str]) -> list[str]:
    """Return the names in options that may be given several times and may hold lists.

    Examples
    --------
    >>> names_of(["a,b", "c"])
    ['a', 'b', 'c']
    """
    return [name.strip() for text in texts for name in text.split(",")]


def configured(
    config: Path | None, *entries: tuple[str, str, Any], is_law_open: bool = False
) -> Configuration:
    """Return the configuration of a file and the command line.

    Parameters
    ----------
    config : pathlib.Path or None
        TOML file.
    entries : tuple of str, str, any
        Option as typed, key that it sets as in "rig.skew", value; None means not given.
    is_law_open : bool
        The logs choose the law.
    """
    from damperfit.configuration.loading import load_configuration

    sections: dict[str, dict[str, Any]] = {}
    options: dict[str, str] = {}
    for option, place, value in entries:
        if value is not None:
            section, _, key = place.partition(".")
            sections.setdefault(section, {})[key] = value
            options[place] = option
    return load_configuration(config, overlay=sections, options=options, is_law_open=is_law_open)


def declared_setting(text: str | None, configuration: Configuration) -> Setting | None:
    """Return the setting that ``--setting`` gives.

    Raises
    ------
    ConfigurationError
        The text is none.
    """
    from damperfit.tested.setting import parse_setting

    try:
        return None if text is None else parse_setting(text, configuration.reading.adjusters)
    except ValueError as error:
        raise ConfigurationError(f"{error}", where=Option("setting", text)) from error


def refuse_beside(option: str, others: Mapping[str, Any], *, why: str) -> None:
    """Refuse options that cannot be combined with another one.

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


def with_typed_option(message: str, argv: Sequence[str], options: Collection[str]) -> str:
    """Return a refusal that begins with a file, with the option before it that gave the file.

    Parameters
    ----------
    message : str
        As in "rig.toml:3: unknown key ...".
    argv : sequence of str
        What was typed.
    options : collection of str
        Those that take a file or folder.

    Examples
    --------
    >>> with_typed_option("a.toml:3: no", ["inspect", "--config", "a.toml"], {"--config"})
    '--config a.toml:3: no'
    >>> with_typed_option("cannot write to b: full", ["identify", "--out=b"], {"--out"})
    '--out b: cannot be written: full'
    """
    text = message.removeprefix(_UNWRITTEN)
    is_unwritten = text != message
    if any(message.startswith(f"{option[2:]} {value}:") for option, value in _typed(argv)):
        return f"--{message}"
    for option, value in _typed(argv):
        for place in _places(value, is_unwritten=is_unwritten) if option in options else ():
            rest = text.removeprefix(place)
            if rest == text or rest[:1] not in {":", "/", "\\"}:
                continue
            if is_unwritten:
                return f"{option} {value}: cannot be written{rest}"
            return f"{option} {value}{rest}"
    return message


def _places(value: str, *, is_unwritten: bool) -> Iterator[str]:
    """Yield what messages may call a file that was typed: itself, in full, where it would stand."""
    if not value:
        return
    path = Path(value)
    yield from (value, str(path))
    with suppress(OSError):  # the working folder is gone
        yield os.path.realpath(path)
    if is_unwritten and path.parent != Path():
        yield str(path.parent)


def check_places(*folders: Path | None) -> None:
    """Refuse what can never be written, before any work is done; None: nothing is to be written.

    Raises
    ------
    ConfigurationError, OutputError
        As of `damperfit.store.check_writable`.
    """
    from damperfit.store import check_writable

    for folder in folders:
        if folder is not None:
            check_writable(folder)


def _typed(argv: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield each option with what follows it, --name value or --name=value."""
    for word, after in zip(argv, (*argv[1:], ""), strict=True):
        if word.startswith("--"):
            option, equals, value = word.partition("=")
            yield option, value if equals else after
