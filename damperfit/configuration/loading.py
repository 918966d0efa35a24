"""Configuration: defaults.toml, then a file, then the command line, to one frozen `Configuration`.

A profile of a rig goes before [rig] for its logs; the command line goes before both.
``defaults.toml`` is complete and commented, and is the documentation of the configuration. No
default stands anywhere else. A key that defaults.toml does not know is an error.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from damperfit.configuration.damper_section import damper_defaults
from damperfit.configuration.schema import build_configuration
from damperfit.damper.model import model_named
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.io.files import IrregularFileError, read_text
from damperfit.problem import FilePlace, Key, Option

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pydantic_core import ErrorDetails

    from damperfit.configuration.options import Configuration

__all__ = ["configuration_toml", "load_configuration"]

_MAX_BYTES = 1_000_000  # a configuration is a page; anything larger is some other file
_DEFAULTS = "defaults.toml"
_OF_FILE = Option("config")
_DEFAULT_MODEL = "purdy"
_OF_VALVES = "twin_tube"  # whose geometry and gas the other layouts share
_NAME_A_MODEL = (
    ' The paper\'s model has none; real valves do: add model = "twin_tube", "monotube" or '
    '"through_flow", or let the logs choose, with identify --model auto.'
)
_TEMPERATURES = {"rig.temperature", "rig.temperature_tolerance"}
_WHOLE = "adjusters"  # its keys are the user's: it takes the place of the one before
_SECTIONS = ("conditioning", "rig", "identification", "simulation", "damper", "output")
# What pydantic refuses, by its kind, and what it then has expected.
_EXPECTED = {
    "int": "a whole number",
    "int_from_float": "a whole number",
    "float": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "string": "a text",
    "list": "a list",
    "dict": "a section of keys",
    "greater_than": "more than {gt:g}",
    "greater_than_equal": "{ge:g} or more",
    "less_than": "less than {lt:g}",
    "less_than_equal": "{le:g} or less",
    "literal_error": "{expected}",
}
_HEADER = re.compile(r"\s*\[([^\[\]]+)\]")
_ENTRY = re.compile(r"(?P<key>\w+) = (?P<value>[^#]*[^#\s])(?P<comment>\s*#.*)?$")


def load_configuration(
    path: str | Path | None = None,
    *,
    overlay: Mapping[str, Mapping[str, Any]] | None = None,
    options: Mapping[str, Option] | None = None,
    is_law_open: bool = False,
) -> Configuration:
    """Return the configuration in force.

    Parameters
    ----------
    path : str or Path, optional
        TOML file; its keys replace those of defaults.toml.
    overlay : mapping, optional
        Sections and keys that replace those of the file, as from the command line.
    options : mapping of str to Option, optional
        What gave a key of ``overlay``, as in {"rig.skew": Option("skew")}: a mistake in its value
        is named by it.
    is_law_open : bool
        The logs choose the law: where no model is named, [damper] may have what real valves have.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or a key or value in it is wrong; the message names file, line
        and key, or the option.
    """
    given = [] if path is None else [_file_layer(Path(path))]
    if overlay:
        given.append(_Layer("", "", overlay, options or {}))
    known = {**_defaults(), "damper": damper_defaults(_model_of(given, is_law_open=is_law_open))}
    document = deepcopy(_defaults())
    if known["damper"]["model"] != _DEFAULT_MODEL:
        document["damper"] = deepcopy(known["damper"])
    for layer in given:
        _check_keys(layer, known=known)
        if not layer.name:
            _put_over_profiles(document["rig"], layer.values.get("rig", {}))
        if layer.values.get(_WHOLE):
            document.pop(_WHOLE, None)
        _merge(document, layer.values)
    declared = frozenset(
        f"{section}.{key}"
        for layer in given
        for section, values in layer.values.items()
        for key in values
    )
    has_damper = any(key.startswith("damper.") and key != "damper.model" for key in declared)
    is_other = known["damper"]["model"] != _DEFAULT_MODEL and "rod_diameter" in known["damper"]
    if (has_damper or is_other) and declared.isdisjoint(_TEMPERATURES):
        # The paper's 26 degC is no window of another damper's test.
        document["rig"]["temperature_tolerance"] = math.inf
    try:
        found = build_configuration(document, declared=declared)
    except ValidationError as error:
        raise _explained(
            error, [_Layer(_DEFAULTS, _defaults_text(), _defaults()), *given]
        ) from error
    except ConfigurationError as error:
        raise _blamed(error, given) from error
    typed = (overlay or {}).get("rig", {})
    facts = frozenset(typed.get("tested_at", {})) | ({"skew"} & set(typed))
    return replace(found, test=found.test.but(typed=facts))


def _model_of(given: Sequence[_Layer], *, is_law_open: bool) -> str:
    """Return the model that the last layer names which names one.

    Where none does and the logs choose the law, keys of real valves are as good as a name.
    """
    name = _DEFAULT_MODEL
    sections = [(one, one.values.get("damper")) for one in given]
    if is_law_open:
        keys = {key for _, damper in sections if isinstance(damper, dict) for key in damper}
        of_valves = keys & set(damper_defaults(_OF_VALVES)) - set(damper_defaults(name))
        name = _OF_VALVES if of_valves else name
    for layer, damper in sections:
        found = damper.get("model", name) if isinstance(damper, dict) else name
        if not isinstance(found, str):
            wrong = f"expected the name of a model, found {found!r}"
            raise layer.blame(ConfigurationError(wrong, code="unknown-model"), "damper", "model")
        try:
            name = model_named(found).name
        except ConfigurationError as error:
            raise layer.blame(error, "damper", "model") from error
    return name


@dataclass(slots=True)
class _Layer:
    """One source of configuration: its name (of the command line none), its text, its values."""

    name: str
    text: str
    values: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Option] = field(default_factory=dict)

    def blame(self, error: ConfigurationError, *keys: str) -> ConfigurationError:
        """Return an error with what a reader looks for: the option, else file, line and key."""
        option = self.options.get(".".join(keys[:2]))
        if option is None:
            return error.at(self.place(*keys), subject=".".join(keys))
        # An option that is given several times has no places: what was found says which.
        inner = ".".join(key for key in keys[2:] if not key.isdigit())
        if option.key or not inner:
            key = ".".join(filter(None, (option.key, inner)))
            return error.at(replace(option, key=key), subject="")
        return error.at(option, subject=inner)

    def place(self, *keys: str) -> FilePlace | None:
        """Return file and line of a key inside others, as far as the text tells."""
        if not self.name:
            return None
        found = (
            self._line(".".join(keys[:depth]), *keys[depth : depth + 1])
            for depth in range(len(keys), 0, -1)
        )
        option = None if self.name == _DEFAULTS else _OF_FILE
        return FilePlace(self.name, next(filter(None, found), 0), option)

    def _line(self, section: str, key: str = "") -> int:
        """Return the line of a key in a section, or of its heading; 0: there is none."""
        current = ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            if found := _HEADER.match(line):
                current = re.sub(r"[\"'\s]", "", found[1])
            is_here = current == section and re.match(rf"\s*[\"']?{re.escape(key)}\b", line)
            if is_here or (not key and current == section):
                return number
        return 0


def _defaults_text() -> str:
    folder = resources.files("damperfit.configuration")
    return (folder / _DEFAULTS).read_text(encoding="utf-8")


@cache
def _defaults() -> dict[str, Any]:
    return tomllib.loads(_defaults_text())


def _file_layer(path: Path) -> _Layer:
    place = FilePlace(str(path), 0, _OF_FILE)
    try:
        text = read_text(path, max_bytes=_MAX_BYTES)
        return _Layer(str(path), text, tomllib.loads(text))
    except IrregularFileError as error:
        raise ConfigurationError(
            f"{error.strerror}; this is not a configuration file",
            subject=path,
            code="not-a-configuration",
        ) from error
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read: {error.strerror}", where=place, code="unreadable"
        ) from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(
            f"not UTF-8 text, at byte {error.start}", where=place, code="not-utf8"
        ) from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ConfigurationError(
            f"not valid TOML: {error}", where=place, code="not-toml"
        ) from error


def _check_keys(layer: _Layer, *, known: Mapping[str, Any]) -> None:
    """Refuse sections and keys that defaults.toml does not have."""
    for section, values in layer.values.items():
        if section not in known:
            raise ConfigurationError(
                f"unknown section [{section}]; "
                f"there are {', '.join(known)}.{did_you_mean(section, known)}",
                where=layer.place(section),
                code="unknown-section",
            )
        if not isinstance(values, dict):
            raise _no_section(section, layer.place())
        if section != _WHOLE:
            _check_section(layer, values, known[section], section)


def _no_section(name: str, place: FilePlace | None) -> ConfigurationError:
    text = f"{name} is a section: write [{name}]"
    return ConfigurationError(text, where=place, code="not-a-section")


def _check_section(
    layer: _Layer, values: Mapping[str, Any], known: Mapping[str, Any], *section: str
) -> None:
    """Refuse keys that a section does not have; of [damper] those inside its sections too."""
    name = ".".join(section)
    for key, value in values.items():
        if key not in known:
            hint = did_you_mean(key, known) or f" There are {', '.join(known)}."
            is_papers = section == ("damper",) and known.get("model") == _DEFAULT_MODEL
            if is_papers and key in damper_defaults(_OF_VALVES):
                hint = _NAME_A_MODEL
            raise ConfigurationError(
                f"unknown key '{key}' in [{name}].{hint}",
                where=layer.place(*section, key),
                code="unknown-key",
            )
        if section[0] == "damper" and isinstance(known[key], dict):
            if not isinstance(value, dict):
                raise _no_section(f"{name}.{key}", layer.place(*section, key))
            _check_section(layer, value, known[key], *section, key)


def _merge(document: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Put values over the document; tables key by key, everything else as a whole."""
    for key, value in values.items():
        if isinstance(value, dict) and isinstance(document.get(key), dict):
            _merge(document[key], value)
        else:
            document[key] = deepcopy(value)


def _put_over_profiles(rig: dict[str, Any], typed: Mapping[str, Any]) -> None:
    """Give what the command line says to every profile that says otherwise.

    In the document and not beside it, so that what `configuration_toml` prints reads logs alike.
    --skew is of all logs: what [rig] and its profiles say of single ones is left out.
    """
    profiles = rig["profiles"]
    inner = list(profiles.values()) if isinstance(profiles, dict) else []
    for section in (rig, *inner):
        facts = section.get("tested_at") if isinstance(section, dict) else None
        if "skew" in typed and isinstance(facts, dict):
            facts.pop("skew", None)
    for profile in inner:
        if isinstance(profile, dict):
            _merge(profile, {key: value for key, value in typed.items() if key in profile})


def _blamed(error: ConfigurationError, given: Sequence[_Layer]) -> ConfigurationError:
    """Return a mistake with the place of the key that it names, where that was given last."""
    where = error.problem.where
    if not isinstance(where, Key):
        return error
    *section, key = where.path
    sections = [tuple(section)] if section else [(one,) for one in _SECTIONS]
    names = (key, *where.beside)
    for layer in reversed(given):
        paths = (
            (name, (*one, name.removeprefix("rig_") if one == ("rig",) else name))
            for name in names
            for one in sections
        )
        for name, path in paths:
            if _depth(layer.values, path) < len(path):
                continue
            if name == key:
                more = {"beside": where.beside} if where.beside else {}
                return layer.blame(error.adding("", **more), *path)
            place = layer.place(*path)
            if place is not None:
                return error.at(place, subject=".".join((*path[:-1], key)))
            itself = error.at(Key((key,)), subject="")
            return layer.blame(ConfigurationError("{problem}", problem=itself), *path)
    return error


def _explained(error: ValidationError, layers: Sequence[_Layer]) -> ConfigurationError:
    """Return the first thing that is wrong, with the layer it came from."""
    first = error.errors(include_url=False)[0]
    keys = [str(part) for part in first["loc"]]
    raised = first.get("ctx", {}).get("error")
    cause = getattr(raised, "__cause__", None)
    if isinstance(cause, ConfigurationError) and isinstance(cause.problem.where, Key):
        where = cause.problem.where
        path = (*keys, *where.path) if keys[-1:] != list(where.path) else tuple(keys)
        return _blamed(cause.at(Key(path, where.beside)), layers[1:])
    reason = str(raised) if raised is not None else _expected(first)
    if keys == ["rig", "profiles"]:
        reason = "expected sections named [rig.profiles.NAME]"
    # pydantic ends with the branch of a union that it tried, which is no key.
    source = max(reversed(layers), key=lambda layer: _depth(layer.values, keys))
    keys = keys[: max(_depth(source.values, keys), 1)]
    found = "" if isinstance(first["input"], dict) else f", found {first['input']!r}"
    return source.blame(ConfigurationError(f"{reason}{found}", code="wrong-value"), *keys)


def _expected(first: ErrorDetails) -> str:
    """Return what pydantic expected, by the kind of its refusal."""
    kind = first["type"].removesuffix("_type").removesuffix("_parsing")
    return f"expected {_EXPECTED.get(kind, 'another value').format(**first.get('ctx', {}))}"


def _depth(values: Any, keys: Sequence[str]) -> int:
    """Return how many of the keys, one inside the other, are there."""
    for depth, key in enumerate(keys):
        if isinstance(values, dict) and key in values:
            values = values[key]
        elif isinstance(values, list | tuple) and key.isdigit() and int(key) < len(values):
            values = values[int(key)]
        else:
            return depth
    return len(keys)


def configuration_toml(configuration: Configuration) -> str:
    """Return the complete configuration as TOML, with the comments of defaults.toml.

    `load_configuration` of the text gives equal settings.
    """
    lines: list[str] = []
    document = configuration.document
    # Sections that defaults.toml does not show as they are, written without its comments.
    own = {_WHOLE: False} | ({"damper": True} if configuration.damper.name != "purdy" else {})
    section = ""
    for line in _defaults_text().splitlines():
        entry = _ENTRY.match(line)
        if header := _HEADER.match(line):
            section = header[1].strip()
            if section in own:
                lines.extend(_section_lines(document[section], section))
                continue
        if section in own and (own[section] or entry):
            continue
        if entry is None:
            lines.append(line)
        else:
            value = _toml_value(document[section][entry["key"]])
            lines.append(f"{entry['key']} = {value}{entry['comment'] or ''}")
    return "\n".join(lines) + "\n"


def _section_lines(values: Mapping[str, Any], section: str) -> Iterator[str]:
    yield f"[{section}]"
    for key, value in values.items():
        if not isinstance(value, dict):
            yield f"{key} = {_toml_value(value)}"
    if section != _WHOLE:
        yield ""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _section_lines(value, f"{section}.{key}")


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(_toml_value(item) for item in value)}]"
    if isinstance(value, dict):
        pairs = (f"{json.dumps(key)} = {_toml_value(item)}" for key, item in value.items())
        return "{" + ", ".join(pairs) + "}"
    return repr(value)
