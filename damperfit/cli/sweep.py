"""``damperfit sweep``: what one parameter does to the force (the paper's Figs 4-9)."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines, print_table, say, screen_columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.model import Model
    from damperfit.queries.simulations import Variation
    from damperfit.reporting.simulated import SweepMember

__all__ = ["sweep"]

_FOLDER = Path("sweep")


@command(api.sweep)
def sweep(how: Shown, **given: Any) -> int:
    """Scale one parameter by factors and show what it does to the force.

    Example: damperfit sweep --setting 10 --vary r_m1=0.8,1,1.2
    """
    out = given["out"] or _FOLDER
    done = api.sweep(**{**given, "out": out})
    if not how.quiet:
        say(f"damperfit: {done.damper}")
        say(f"damperfit: {done.source}")
        for note in done.notes:
            say(f"note: {note}")
        for warning in done.warnings:
            say(f"warning: {warning}")
    if how.json:
        facts = {"damper": done.damper, "source": done.source}
        print_json(facts | {"rows": done.records, "sentences": list(done.sentences)})
    else:
        for (variation, members, _), sentence in zip(done.sweeps, done.sentences, strict=True):
            _show(variation, members, done.model, sentence)
    if not how.quiet:
        figures = f"{len(done.plots)} figure{'s' * (len(done.plots) > 1)}"
        say(f"damperfit: sweep.csv and {figures} written to {out}")
    return 0


def _show(
    variation: Variation, members: Sequence[SweepMember], damper: Model, sentence: str
) -> None:
    from damperfit.queries.simulations import swept_units
    from damperfit.reporting.simulated import sweep_sheet

    sheet = sweep_sheet(variation.name, swept_units(damper)[variation.name], members)
    print_table(sheet)
    print_lines([*wrap(sentence, screen_columns()), ""])
