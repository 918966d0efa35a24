"""``damperfit models``: which law of a damper, and of its rig, the logs tell."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    say_failures,
    screen_columns,
)

if TYPE_CHECKING:
    from damperfit.run.auto_model import LawChoice

__all__ = ["models"]


@command(api.models)
def models(how: Shown, **given: Any) -> int:
    """Fit one damper law after the other to the logs and say which one they support.

    Example: damperfit models runs/*.csv --config damper.toml --hold-out '*_check.csv'
    """

    def tell(line: str) -> None:
        if not how.quiet:
            say(line)

    choice = api.models(**given, on_law=lambda title: tell(f"damperfit: tried {title}"))
    for remark in (*choice.assumed, *choice.remarks):
        tell(f"note: {remark}")
    say_failures(choice.failures, is_debug=how.debug)
    if how.json:
        print_json(choice.document())
    else:
        _show(choice)
    return int(bool(choice.failures or choice.lost))


def _show(choice: LawChoice) -> None:
    from damperfit.reporting.laws import chosen_sheet, rival_sheet, tried_laws_sheet

    width, document = screen_columns(), choice.document()
    print_table(tried_laws_sheet(document, is_narrow=True))
    reasons = [f"{law.tried.title}: {law.reason}" for law in choice.search.laws]
    print_lines(["", *(line for one in reasons for line in wrap(one, width))])
    said = " ".join((f"The logs support {choice.supported}.", *choice.sentences))
    print_lines(["", *wrap(said, width), ""])
    print_table(chosen_sheet(choice.fits))
    if choice.undecided:
        print_lines(["", "What these logs leave open:"])
        print_lines([line for one in choice.undecided for line in wrap(one, width)])
    if choice.rivals:
        print_lines([""])
        print_table(rival_sheet(document))
    if choice.lost:
        from damperfit.identification.sharing import of_settings

        print_lines([f"The chosen law cannot be simulated at {of_settings(choice.lost)}."])
