"""Configuration: defaults.toml, then a file, then the command line, to one frozen `Configuration`.

A profile of a rig goes before [rig] for its logs; the command line goes before both.
``defaults.toml`` is complete and commented, and is the documentation of the configuration. No
default stands anywhere else. A key that defaults.toml does not know is an error.
"""

from __future__ import annotations

import json
import re
import tomllib
from copy import deepcopy
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from damperfit.configuration.options import Configuration
from damperfit.configuration.schema import build_configuration
from damperfit.errors import ConfigurationError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = ["configuration_toml", "load_configuration"]

_MAX_BYTES = 1_000_000  # a configuration is a page; anything larger is some other file
_COMMAND_LINE = "command line"
_HEADER = re.compile(r"\s*\[([^\[\]]+)\]")
_ENTRY = re.compile(r"(?P<key>\w+) = (?P<value>[^#]*[^#\s])(?P<comment>\s*#.*)?$")


def load_configuration(
    path: str | Path | None = None, *, overlay: Mapping[str, Mapping[str, Any]] | None = None
) -> Configuration:
    """Return the configuration in force.

    Parameters
    ----------
    path : str or Path, optional
        TOML file; its keys replace those of defaults.toml.
    overlay : mapping, optional
        Sections and keys that replace those of the file, as from the command line.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or a key or value in it is wrong; the message names file, line
        and key.
    """
    layers = [_Layer("defaults.toml", _defaults_text())]
    if path is not None:
        layers.append(_Layer(str(path), _read(Path(path))))
    document: dict[str, Any] = {}
    for layer in layers:
        layer.values = _parse(layer)
    if overlay:
        layers.append(_Layer(_COMMAND_LINE, "", overlay))
    for layer in layers:
        _check_keys(layer, known=layers[0].values)
        if layer.name == _COMMAND_LINE:
            _put_over_profiles(document, layer.values.get("rig", {}))
        _merge(document, layer.values)
    try:
        return build_configuration(document)
    except ValidationError as error:
        raise ConfigurationError(_explain(error, layers)) from error


@dataclass(slots=True)
class _Layer:
    """One source of configuration: where it stands, its text, its values."""

    name: str
    text: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def place(self, *keys: str) -> str:
        """Return file and line of a key inside others, as far as the text tells."""
        for depth in range(len(keys), 0, -1):
            if line := self._line(".".join(keys[:depth]), *keys[depth : depth + 1]):
                return f"{self.name}:{line}"
        return self.name

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
    return (resources.files("damperfit.configuration") / "defaults.toml").read_text(
        encoding="utf-8"
    )


def _read(path: Path) -> str:
    try:
        if path.is_file() and path.stat().st_size > _MAX_BYTES:
            raise ConfigurationError(f"{path}: larger than 1 MB; this is no configuration file")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: no UTF-8 text at byte {error.start}") from error


def _parse(layer: _Layer) -> dict[str, Any]:
    try:
        return tomllib.loads(layer.text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ConfigurationError(f"{layer.name}: no valid TOML: {error}") from error


def _check_keys(layer: _Layer, *, known: Mapping[str, Any]) -> None:
    """Refuse sections and keys that defaults.toml does not have."""
    for section, values in layer.values.items():
        if section not in known:
            raise ConfigurationError(
                f"{layer.place(section)}: unknown section [{section}]; "
                f"there are {_listed(known)}.{did_you_mean(section, known)}"
            )
        if not isinstance(values, dict):
            raise ConfigurationError(f"{layer.name}: {section} is a section: write [{section}]")
        for key in values:
            if key not in known[section]:
                there = f" There are {_listed(known[section])}."
                raise ConfigurationError(
                    f"{layer.place(section, key)}: unknown key '{key}' in [{section}]."
                    f"{did_you_mean(key, known[section]) or there}"
                )


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def _merge(document: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Put values over the document; tables key by key, everything else as a whole."""
    for key, value in values.items():
        if isinstance(value, dict) and isinstance(document.get(key), dict):
            _merge(document[key], value)
        else:
            document[key] = deepcopy(value)


def _put_over_profiles(document: dict[str, Any], given: Mapping[str, Any]) -> None:
    """Give what the command line says to every profile that says otherwise.

    In the document and not beside it, so that what `configuration_toml` prints reads logs alike.
    """
    profiles = document["rig"]["profiles"]
    for profile in profiles.values() if isinstance(profiles, dict) else ():
        if isinstance(profile, dict):
            _merge(profile, {key: value for key, value in given.items() if key in profile})


def _explain(error: ValidationError, layers: Sequence[_Layer]) -> str:
    """Return the first thing that is wrong, with the layer it came from."""
    first = error.errors(include_url=False)[0]
    keys = [str(part) for part in first["loc"]]
    # pydantic ends with the branch of a union that it tried, which is no key.
    source = max(reversed(layers), key=lambda layer: _depth(layer.values, keys))
    keys = keys[: max(_depth(source.values, keys), 1)]
    reason = first["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    found = "" if isinstance(first["input"], dict) else f", found {first['input']!r}"
    return f"{source.place(*keys)}: {'.'.join(keys)}: {reason}{found}"


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
    section = ""
    lines = []
    for line in _defaults_text().splitlines():
        if header := _HEADER.match(line):
            section = header[1].strip()
        if entry := _ENTRY.match(line):
            value = _toml_value(configuration.document[section][entry["key"]])
            lines.append(f"{entry['key']} = {value}{entry['comment'] or ''}")
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


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
