"""Configuration: the defaults, then a file, then the command line, to one `Configuration`.

A profile of a rig overrides [rig] for its logs; the command line overrides both. A key that no
section has is an error; a mistake is reported with its file and line, or its option.
"""

import json
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import Any

from pydantic import ValidationError

from damperfit.configuration.damper_section import damper_defaults, not_a_section, unknown_key
from damperfit.configuration.drawings import MEASURED
from damperfit.configuration.options import Configuration, build_configuration
from damperfit.damper.model import model_named
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.io.files import IrregularFileError, read_text, why_unread
from damperfit.problem import FilePlace, Key, Option
from damperfit.sections import SECTIONS, ProfileSection

_MAX_BYTES = 1_000_000  # a configuration is a page; anything larger is some other file
_OF_FILE = Option("config")
_PAPERS = "purdy"
_OF_VALVES = "twin_tube"  # whose geometry and gas the other layouts share
_TEMPERATURES = {"rig.temperature", "rig.temperature_tolerance"}
# Where a key that names no section is looked for.
_ORDER = ("conditioning", "rig", "identification", "simulation", "damper", "output")
# What pydantic expected, by the kind of its error.
_EXPECTED = {
    "int": "a whole number",
    "int_from_float": "a whole number",
    "float": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "string": "a text",
    "string_too_short": "a text that is not empty",
    "list": "a list",
    "dict": "a section of keys",
    "greater_than": "more than {gt:g}",
    "greater_than_equal": "{ge:g} or more",
    "less_than": "less than {lt:g}",
    "less_than_equal": "at most {le:g}",
    "literal_error": "{expected}",
}
_HEADER = re.compile(r"\s*\[([^\[\]]+)\]")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_KEY = re.compile(r"\s*(?:([\"'])(.+?)\1|([\w-]+))")  # bare or in quotes


def load_configuration(
    path: str | Path | None = None,
    *,
    overlay: Mapping[str, Mapping[str, Any]] | None = None,
    options: Mapping[str, Option] | None = None,
    is_law_open: bool = False,
) -> Configuration:
    """Return the configuration in force: defaults, a file's keys, and those of ``overlay``.

    ``options`` are those of the overlay's keys, as in {"rig.skew": Option("skew")}: errors name
    them, and the line of a key in a file. ``is_law_open``: the logs choose the law; where no model
    is named, [damper] may have the keys of real valves.
    """
    layers = [] if path is None else [_read(Path(path))]
    if overlay:
        layers.append(_Layer(overlay, options=options or {}))
    for layer in layers:
        for section, values in layer.values.items():
            if section not in SECTIONS:
                hint = f"{', '.join(SECTIONS)}.{did_you_mean(section, SECTIONS)}"
                text = f"unknown section [{section}]; there are {hint}"
                where = layer.place(section)
                raise ConfigurationError(text, where=where, code="unknown-section")
            if not isinstance(values, dict):
                raise layer.blame(not_a_section(section), section)
    model = _model_of(layers, is_law_open=is_law_open)
    document = default_document(model)
    for layer in layers:
        if not layer.name:
            _put_over_profiles(document["rig"], layer.values.get("rig", {}))
        if layer.values.get("adjusters"):  # its keys are the user's: they replace those before
            document["adjusters"] = {}
        _merge(document, layer.values)
    declared = frozenset(
        f"{section}.{key}"
        for layer in layers
        for section, values in layer.values.items()
        for key in values
    )
    has_damper = any(key.startswith("damper.") and key != "damper.model" for key in declared)
    is_other = model != _PAPERS and "rod_diameter" in document["damper"]
    if (has_damper or is_other) and declared.isdisjoint(_TEMPERATURES):
        # The paper's 26 degC is no window of another damper's test.
        document["rig"]["temperature_tolerance"] = math.inf
    try:
        configuration = build_configuration(document, declared=declared)
    except ValidationError as error:
        raise _explained(error, layers) from error
    except ConfigurationError as error:
        raise _blamed(error, layers) from error
    rig = (overlay or {}).get("rig", {})
    facts = frozenset(rig.get("tested_at", {})) | ({"skew"} & set(rig))
    return replace(configuration, test=configuration.test.but(typed=facts))


def default_document(model: str = _PAPERS) -> dict[str, Any]:
    """Return every key of every section with its default, as it would be written."""
    document: dict[str, Any] = {
        name: {key: deepcopy(entry.default) for key, entry in section.entries().items()}
        for name, section in SECTIONS.items()
    }
    return document | {"damper": damper_defaults(model)}


class _Layer:
    """One source of configuration; the command line has no name and text."""

    def __init__(
        self, values: Any, name: str = "", text: str = "", options: Mapping[str, Option] = {}
    ) -> None:
        self.values, self.name, self.text, self.options = values, name, text, options

    def blame(self, error: ConfigurationError, *keys: str) -> ConfigurationError:
        """Return an error with its place: the option, else file, line and key."""
        option = self.options.get(".".join(keys[:2]))
        if option is None:
            is_named = error.problem.code in {"unknown-key", "not-a-section"}  # by the text
            return error.at(self.place(*keys), subject="" if is_named else ".".join(keys))
        # An option that is given several times has no places: what was found says which.
        inner = ".".join(key for key in keys[2:] if not key.isdigit())
        if option.key or not inner:
            key = ".".join(filter(None, (option.key, inner)))
            return error.at(option._replace(key=key), subject="")
        return error.at(option, subject=inner)

    def place(self, *keys: str) -> FilePlace | None:
        """Return file and line of a key inside others, or of its heading; 0: no line has it."""
        if not self.name:
            return None
        places: dict[tuple[str, str], int] = {}
        section = ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            if heading := _HEADER.match(line):
                section = re.sub(r"[\"'\s]", "", heading[1])
            places.setdefault((section, ""), number)
            if key := _KEY.match(line):
                places.setdefault((section, key[2] or key[3]), number)
        for depth in range(len(keys), 0, -1):
            section, inner = ".".join(keys[:depth]), "".join(keys[depth : depth + 1])
            if number := places.get((section, inner), 0):
                return FilePlace(self.name, number, _OF_FILE)
        return FilePlace(self.name, 0, _OF_FILE)


def _read(path: Path) -> _Layer:
    try:
        text = read_text(path, max_bytes=_MAX_BYTES)
        return _Layer(tomllib.loads(text), name=str(path), text=text)
    except IrregularFileError as error:
        reason, code = f"{error.strerror}; this is not a configuration file", "not-a-configuration"
        raise ConfigurationError(reason, subject=path, code=code) from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        reason, code = f"not valid TOML: {error}", "not-toml"
        if isinstance(error, OSError):
            reason, code = why_unread(error), "unreadable"
        elif isinstance(error, UnicodeDecodeError):
            reason, code = f"not UTF-8 text, at byte {error.start}", "not-utf8"
        place = FilePlace(str(path), 0, _OF_FILE)
        raise ConfigurationError(reason, where=place, code=code) from error


def _model_of(layers: Sequence[_Layer], *, is_law_open: bool) -> str:
    """Return the last model that a layer names."""
    name = _PAPERS
    if is_law_open:  # keys of real valves are as good as a name
        keys = {key for layer in layers for key in layer.values.get("damper", {})}
        if keys & set(damper_defaults(_OF_VALVES)) - set(damper_defaults(name)):
            name = _OF_VALVES
    for layer in layers:
        model = layer.values.get("damper", {}).get("model", name)
        if not isinstance(model, str):
            text = f"expected the name of a model, found {model!r}"
            raise layer.blame(ConfigurationError(text, code="unknown-model"), "damper", "model")
        try:
            name = model_named(model).name
        except ConfigurationError as error:
            raise layer.blame(error, "damper", "model") from error
    return name


def _merge(document: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Put values over the document; tables key by key, everything else as a whole."""
    for key, value in values.items():
        if isinstance(value, dict) and isinstance(document.get(key), dict):
            _merge(document[key], value)
        else:
            document[key] = deepcopy(value)


def _put_over_profiles(rig: dict[str, Any], typed: Mapping[str, Any]) -> None:
    """Override the profiles by the values of the command line."""
    # In the document, so that what `configuration_toml` prints reads logs in the same way. --skew
    # is of all logs: what [rig] and its profiles say of single ones is left out.
    profiles = rig["profiles"] if isinstance(rig["profiles"], dict) else {}
    inner = [profile for profile in profiles.values() if isinstance(profile, dict)]
    for section in (rig, *inner):
        if "skew" in typed and isinstance(section.get("tested_at"), dict):
            section["tested_at"].pop("skew", None)
    for profile in inner:
        _merge(profile, {key: value for key, value in typed.items() if key in profile})


def _blamed(error: ConfigurationError, layers: Sequence[_Layer]) -> ConfigurationError:
    """Return an error with the place of its key, in the last layer that has it."""
    where = error.problem.where
    if not isinstance(where, Key):
        return error
    *section, key = where.path
    sections = [tuple(section)] if section else [(name,) for name in _ORDER]
    for layer in reversed(layers):
        for name in (key, *where.beside):
            for parent in sections:
                path = (*parent, name)
                if _depth(layer.values, path) < len(path):
                    continue
                if name == key:
                    beside = {"beside": where.beside} if where.beside else {}
                    return layer.blame(error.adding("", **beside), *path)
                if (place := layer.place(*path)) is not None:
                    return error.at(place, subject=".".join((*path[:-1], key)))
                itself = error.at(Key((key,)), subject="")
                return layer.blame(
                    ConfigurationError("{problem}", code=error.problem.code, problem=itself), *path
                )
    return error


def _explained(error: ValidationError, layers: Sequence[_Layer]) -> ConfigurationError:
    """Return the first error, with the place in its layer."""
    errors = error.errors(include_url=False)
    issue = next((issue for issue in errors if issue["type"] == "extra_forbidden"), errors[0])
    keys = [str(key) for key in issue["loc"]]
    context = issue.get("ctx", {})
    kind = issue["type"].removesuffix("_type").removesuffix("_parsing")
    # pydantic ends with the branch of a union that it tried, which is no key.
    source = max(reversed(layers), key=lambda layer: _depth(layer.values, keys))
    keys = keys[: max(_depth(source.values, keys), 1)]
    entries = (ProfileSection if keys[:2] == ["rig", "profiles"] else SECTIONS[keys[0]]).entries()
    if kind == "extra_forbidden":
        return source.blame(unknown_key(keys[-1], entries, *keys[:-1]), *keys)
    if kind == "model" or (kind == "dict" and len(keys) == 1):
        return source.blame(not_a_section(*keys), *keys)
    reason = str(context.get("error", ""))
    if keys == ["rig", "profiles"]:
        reason = "expected sections named [rig.profiles.NAME]"
    entry = entries.get(keys[-1])
    if not reason:
        word = f"{entry.word!r} or " if entry is not None and entry.word else ""
        reason = f"expected {word}{_EXPECTED.get(kind, 'another value').format(**context)}"
    code = "out-of-range" if kind.startswith(("greater", "less")) else "wrong-value"
    if kind.endswith("_equal") and context.get("ge") != 0 and entry is not None and entry.dimension:
        unit = entry.default.lstrip("0123456789.").replace("mm", "m")
        example = f", as in {entry.default!r}" * (entry.default[0] != "0")
        reason += f" {unit}" * (kind == "less_than_equal")
        reason += f"; a bare number is in {unit}{example}"
    typed: Any = source.values
    for key in keys[: _depth(source.values, keys)]:  # as it was written, not as it was converted
        typed = typed[int(key) if isinstance(typed, list | tuple) else key]
    found = "" if isinstance(typed, dict) else f", found {typed!r}"
    if near := did_you_mean(str(typed), entry.words if entry is not None else ()):
        found += f".{near}"
    return source.blame(ConfigurationError(f"{reason}{found}", code=code), *keys)


def _depth(values: Any, keys: Sequence[str]) -> int:
    """Return how many of the nested keys exist."""
    for depth, key in enumerate(keys):
        if isinstance(values, dict) and key in values:
            values = values[key]
        elif isinstance(values, list | tuple) and key.isdigit() and int(key) < len(values):
            values = values[int(key)]
        else:
            return depth
    return len(keys)


# The page

_PREFACE = """\
# The complete configuration of damperfit; its defaults are the damper and test of D. J. Purdy,
# "Theoretical and experimental investigation into an adjustable automotive damper", 2000.
#
# A configuration file (--config FILE.toml) needs only the keys that differ; options on the command
# line take precedence. An unknown key is an error. A quantity is text with a unit ("19mm",
# "4.6bar", "1.5Hz") or a bare number in SI (m, Pa, Hz, kg/m3, N).
"""
_COLUMN, _WIDE = 33, 108  # where comments begin, and end


def configuration_toml(configuration: Configuration) -> str:
    """Return the complete configuration as TOML, each key with its meaning.

    `load_configuration` of the text gives equal settings.
    """
    lines: list[str] = [_PREFACE]
    for name, section in SECTIONS.items():
        comments = {key: entry.about for key, entry in section.entries().items()}
        lines += _section_lines(name, configuration.document[name], section.about, comments)
    return "\n".join(lines)


def _section_lines(
    name: str, values: Mapping[str, Any], heading: str, comments: Mapping[str, str]
) -> Iterator[str]:
    yield f"[{name}]"
    yield from (f"# {line}" for line in heading.splitlines())
    is_damper = name == "damper"
    inner = {key: value for key, value in values.items() if is_damper and isinstance(value, dict)}
    for key, value in values.items():
        if key in inner:
            continue
        entry = f"{key} = {toml_value(value)}"
        comment = comments.get(key) or (MEASURED.get(key, "") if is_damper else "")
        if len(entry) >= _COLUMN and comment:
            yield from (f"# {line}" for line in wrap(f"{comment}:", _WIDE))
            yield entry
            continue
        first, *others = wrap(comment, _WIDE - _COLUMN, break_long_words=False) or [""]
        yield f"{entry:<{_COLUMN}}# {first}" if first else entry
        yield from (f"{'':<{_COLUMN}}# {line}" for line in others)
    yield ""
    for key, value in inner.items():
        yield from _section_lines(f"{name}.{key}", value, "", {})


def toml_value(value: Any) -> str:
    """Return a value as TOML; text without escapes where possible."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        if "\\" in value and value.isprintable() and "'" not in value:
            return f"'{value}'"
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(item) for item in value)}]"
    if isinstance(value, dict):
        names = (key if _BARE.fullmatch(key) else json.dumps(key) for key in value)
        pairs = (f"{n} = {toml_value(v)}" for n, v in zip(names, value.values(), strict=True))
        return "{" + ", ".join(pairs) + "}"
    return repr(value)
