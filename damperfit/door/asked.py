"""Keywords of a call to a configuration: the same keys and checks as on the command line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

from damperfit.configuration.loading import load_configuration
from damperfit.door.wrong_calls import path_of
from damperfit.errors import ConfigurationError
from damperfit.tested.setting import Setting, parse_setting

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model

__all__ = [
    "configured",
    "declared_setting",
    "known_as_setting",
    "names_given",
    "refuse_idle_share",
    "texts",
    "workers",
]


def refuse_idle_share(configuration: Configuration, call: str) -> None:
    """Refuse to share parameters where no fit would.

    Raises
    ------
    ConfigurationError
        The procedure is not joint.
    """
    if (procedure := configuration.identification.procedure) != "joint":
        raise ConfigurationError(
            f"{call}(share=...): only procedure 'joint' fits shared parameters, found "
            f"{procedure!r}; give procedure='joint'"
        )


def configured(
    call: str,
    *,
    config: str | Path | None = None,
    damper: Model | Mapping[str, Any] | None = None,
    rig: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
    **entries: Any,
) -> Configuration:
    """Return the configuration that the keywords of a call ask for.

    Parameters
    ----------
    call : str
        The function, for messages.
    config : path, optional
        TOML file.
    damper : Model or mapping, optional
        The damper, or keys of [damper] such as ``{"rod_diameter": "12mm"}``.
    rig : mapping, optional
        Keys of [rig].
    units : mapping of str to str, optional
        Units of columns that do not say theirs, as in ``{"force": "kN"}``.
    **entries : tuple of str and any
        By keyword: the key that it sets, as in "identification.free", and the value; None is not
        given.

    Raises
    ------
    ConfigurationError
        A key or value is wrong; the keyword is named.
    """
    sections: dict[str, dict[str, Any]] = {}
    options: dict[str, str] = {}
    for keyword, entry in entries.items():
        if not (isinstance(entry, tuple) and len(entry) == 2 and str(entry[0]).count(".") == 1):
            raise ConfigurationError(
                f"no keyword {keyword!r}; help({call}) lists them", subject=call
            )
    for name, mapping in (("rig", rig), ("units", units)):
        _mapping(call, name, mapping)
    for keyword, (place, value) in entries.items():
        if value is not None:
            section, _, key = place.partition(".")
            sections.setdefault(section, {})[key] = value
            options[place] = f"{call}({keyword}=...)"
    for key, value in (rig or {}).items():
        sections.setdefault("rig", {})[key] = value
        options[f"rig.{key}"] = f"{call}(rig={{{key!r}: ...}})"
    if units:
        sections.setdefault("rig", {})["units"] = dict(units)
        options["rig.units"] = f"{call}(units=...)"
    if config is not None:
        config = path_of(config, f"{call}(config=...)", "the path of a TOML file")
    if damper is not None:
        sections["damper"] = {**_declared(damper, call), **sections.get("damper", {})}
    try:
        return load_configuration(config, overlay=sections, options=options)
    except ConfigurationError as error:
        said = str(error).removeprefix("command line: ")
        raise ConfigurationError(said if said.startswith(call) else f"{call}: {said}") from error


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
    if value is None:
        return
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


def texts(values: Mapping[str, Any] | None, call: str, keyword: str) -> dict[str, str] | None:
    """Return values as the command line has them: 32mm, or a number in SI.

    Raises
    ------
    ConfigurationError
        They are no mapping.
    """
    _mapping(call, keyword, values)
    return None if values is None else {name: str(value) for name, value in values.items()}


def workers(jobs: Any, call: str) -> int | None:
    """Return how many workers are asked for; None: as many as there are cores.

    Raises
    ------
    ConfigurationError
        It is no whole number above 0.
    """
    if jobs is None:
        return None
    if type(jobs) is bool or not isinstance(jobs, Integral) or int(jobs) < 1:
        raise ConfigurationError(
            f"{call}(jobs=...): found {jobs!r}; expected a whole number above 0"
        )
    return int(jobs)


def declared_setting(
    setting: Setting | int | str | None, configuration: Configuration
) -> Setting | None:
    """Return the setting that is meant, by its label or number.

    Raises
    ------
    ConfigurationError
        It is none.
    """
    setting = known_as_setting(setting, "setting=...")
    if setting is None or isinstance(setting, Setting):
        return setting
    try:
        return parse_setting(str(setting), configuration.reading.adjusters)
    except ValueError as error:
        raise ConfigurationError(f"setting={setting!r}: {error}") from error


def known_as_setting(setting: Any, call: str) -> Setting | int | str | None:
    """Return a setting as it was given: its number, its label, or itself.

    Raises
    ------
    ConfigurationError
        It is nothing of the kind.
    """
    if setting is None or isinstance(setting, Setting | str):
        return setting
    is_yes_or_no = isinstance(setting, bool)
    if isinstance(setting, Real) and not is_yes_or_no:
        number = float(setting)
        return int(number) if number.is_integer() else str(number)
    raise ConfigurationError(
        f"found {type(setting).__name__}; expected a setting such as 10 or 'R12 C8'", subject=call
    )


def names_given(names: Iterable[str] | None, keyword: str) -> list[str] | None:
    """Return names given as a list, or as text with commas, to a keyword of `identify`.

    Raises
    ------
    ConfigurationError
        They are neither.
    """
    if names is None or isinstance(names, str):
        return None if names is None else names.split(",")
    if not isinstance(names, Iterable):
        raise ConfigurationError(
            f"damperfit.identify({keyword}=...): found {names!r}; expected a list of names"
        )
    return list(names)
