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


def _listed(*places: str) -> Callable[[Any], Iterable[str]]:
    """Return what gives the names of tables in modules."""

    def names(_: Any) -> list[str]:
        parts = [place.rpartition(".") for place in places]
        return [name for module, _, own in parts for name in getattr(import_module(module), own)]

    return names


def _topics(context: typer.Context) -> Iterable[str]:
    commands = getattr(getattr(context.parent, "command", None), "commands", ())
    return (*_listed("damperfit.manual.TOPICS")(context), *commands)


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


# Words, or what finds them, by keyword.
_WORDS: dict[str, tuple[str, ...] | Callable[[Any], Iterable[str]]] = {
    "stroke": ("rebound", "compression"),
    "figures": ("png", "svg", "pdf"),
    "color": ("auto", "always", "never"),
    "covariate": ("temperature",),
    "skew": ("auto",),
    "bulk_modulus": ("free", "appendix1"),
    "model": lambda context: ("auto", *_listed("damperfit.damper.model.MODELS")(context)),
    "to": _listed("damperfit.exporting.targets.TARGETS"),
    "check": _listed("damperfit.checks.CHECK_LISTS", "damperfit.checks.CHECKS"),
    "layout": _listed("damperfit.laws.structures.LAYOUTS"),
    "topic": _topics,
    "procedure": _procedures,
    "setting": _settings,
    **dict.fromkeys(("free", "share", "untie", "profile", "for_"), _quantities),
}


def completion_of(name: str, key: str) -> Callable[..., list[str]] | None:
    """Return what completes the values of a keyword; None where they are anything."""
    section, _, own = key.partition(".")
    entry = SECTIONS[section].entries().get(own) if section in SECTIONS else None
    known = (entry.words if entry is not None else ()) or _WORDS.get(name)
    if known is None:
        return None

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        """Return what may be typed on; after a comma, what follows it."""
        first, comma, last = incomplete.rpartition(",")
        words: Iterable[str] = ()
        with suppress(Exception):  # results that cannot be read complete nothing
            words = known if isinstance(known, tuple) else known(ctx)
        return [f"{first}{comma}{word}" for word in words if word.startswith(last)]

    return complete
