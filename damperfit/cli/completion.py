"""Values of options that the shell completes; each list is looked up when it is asked for."""

from __future__ import annotations

import csv
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from damperfit.configuration.sections import SECTIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


_WORDS = {
    "model": ("auto",),
    "stroke": ("rebound", "compression"),
    "figures": ("png", "svg", "pdf"),
    "color": ("auto", "always", "never"),
    "covariate": ("temperature",),
    "skew": ("auto",),
    "bulk_modulus": ("free", "appendix1"),
}


# Names that stand in modules, by keyword.
_NAMES = {
    "model": ("damperfit.damper.model.MODELS",),
    "to": ("damperfit.exporting.targets.TARGETS",),
    "check": ("damperfit.checks.CHECK_LISTS", "damperfit.checks.CHECKS"),
    "layout": ("damperfit.laws.structures.LAYOUTS",),
}


def _topics(context: typer.Context) -> Iterable[str]:
    from damperfit.manual import TOPICS

    return (*TOPICS, *getattr(getattr(context.parent, "command", None), "commands", ()))


def _procedures(_: typer.Context) -> Iterable[str]:
    from damperfit.damper.model import MODELS

    return dict.fromkeys(name for model in MODELS.values() for name in model.procedures)


def _quantities(context: typer.Context) -> Iterable[str]:
    """Columns of the model that was typed before, else of the paper's."""
    from damperfit.damper.model import MODELS

    model = MODELS.get(context.params.get("model") or "", MODELS["purdy"])
    return model().names


def _settings(context: typer.Context) -> Iterable[str]:
    """Settings of the results that were typed before, or would be taken."""
    given = context.params.get("parameters") or context.params.get("results") or "results"
    # An argument is not bound yet while what follows it is completed.
    place = Path(context.args[0] if context.args else given)
    table = place / "parameters.csv" if place.is_dir() else place
    with table.open(encoding="utf-8") as file:
        return [row["setting"] for row in csv.DictReader(file)]


_LOOKED_UP: dict[str, Callable[[typer.Context], Iterable[str]]] = {
    "topic": _topics,
    "procedure": _procedures,
    "free": _quantities,
    "share": _quantities,
    "untie": _quantities,
    "profile": _quantities,
    "for_": _quantities,
    "setting": _settings,
}


def completion_of(name: str, key: str) -> Callable[..., list[str]] | None:
    """Return what completes the values of a keyword; None where they are anything."""
    section, _, own = key.partition(".")
    entry = SECTIONS[section].entries().get(own) if section in SECTIONS else None
    words = (entry.words if entry is not None else ()) or _WORDS.get(name, ())
    find = _LOOKED_UP.get(name)
    if not words and find is None and name not in _NAMES:
        return None

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        """Return what may be typed on; after a comma, what follows it."""
        first, comma, last = incomplete.rpartition(",")
        known: list[Any] = list(words)
        for place in _NAMES.get(name, ()):
            module, _, listed = place.rpartition(".")
            known += getattr(import_module(module), listed)
        if find is not None:
            known = []
            with suppress(Exception):  # results that cannot be read complete nothing
                known = list(find(ctx))
        return [f"{first}{comma}{word}" for word in known if word.startswith(last)]

    return complete
