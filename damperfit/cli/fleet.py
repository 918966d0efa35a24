"""``damperfit fleet``: many dampers, one Parquet part each, never done twice."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines, say
from damperfit.errors import DamperfitError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.answers import FleetDone
    from damperfit.fleets.survey import HeldFleet
    from damperfit.run.identify import Watch

__all__ = ["fleet"]

_MANY = 20  # failures that are listed one by one; the parts hold them all


@command(api.fleet)
def fleet(how: Shown, **given: Any) -> int:
    """Fit many dampers, one part each; finished ones are not fitted again.

    Example: damperfit fleet runs --out fleet --collect
    """
    fault = None
    try:
        found = api.fleet(**given, watch=_looking_on(is_quiet=how.quiet))
    except DamperfitError as error:
        if not hasattr(error, "done"):
            raise
        fault, found = error, error.done  # parts are done, and could not be collected
    _say(found, is_quiet=how.quiet)
    if not how.quiet and found.n_rows is not None:
        table = found.folder / "fleet.parquet"
        say(f"damperfit: {found.n_rows} rows of the fleet in {table} and .csv")
        if found.page is not None:
            say(f"damperfit: {found.page} written, with tables of dampers and outliers")
    if fault is not None:
        raise fault
    if how.json:
        print_json(found.document())
    else:
        summary = _summary(found) if given["logs"] else ()
        print_lines([*summary, *_held_lines(found.held)])
    return found.code


def _looking_on(*, is_quiet: bool) -> Watch:
    """Who looks on: a bar that counts dampers, and a signal that ends the fleet."""
    from damperfit.cli.interrupt import stop_on_signal
    from damperfit.cli.progress import fleet_progress
    from damperfit.run.identify import Watch

    here: dict[str, Any] = {"advance": lambda: None, "cancelled": lambda: False}

    @contextmanager
    def working() -> Iterator[None]:
        with stop_on_signal("dampers that are done are kept") as cancelled, ExitStack() as stack:
            here.update(cancelled=cancelled, stack=stack)
            yield

    def start(number: int) -> None:
        bar = fleet_progress(number, is_wanted=not is_quiet)
        here["advance"] = here["stack"].enter_context(bar)

    return Watch(
        on_start=start,
        on_fit=lambda _: here["advance"](),
        cancelled=lambda: bool(here["cancelled"]()),
        during_work=working,
    )


def _held_lines(held: HeldFleet | None) -> list[str]:
    if held is None:
        return []
    lines = [
        f"{point.run or 'unknown'}{f', setting {point.setting}' if str(point.setting) else ''}"
        f"{f', {point.speed:g} m/s {point.stroke}' if point.stroke else ''}: {point.words}"
        for point in held.worst[:_MANY]
    ]
    more = len(held.worst) - _MANY
    if more > 0:
        lines.append(f"and {more} more damper{'s' * (more > 1)}; --report lists them")
    return [f"tolerance {held.source}: {held.sentence}", *lines]


def _say(found: FleetDone, *, is_quiet: bool) -> None:
    done, n_tasks, out = found.done, found.n_tasks, found.folder
    lines = [f"{one.owner or 'logs'}: {line}" for one in done for line in one.failures]
    for line in lines[:_MANY]:
        say(f"damperfit: {line}")
    if len(lines) > _MANY:
        say(f"damperfit: and {len(lines) - _MANY} more failures; the parts in {out} hold them all")
    for one in done:
        for gate in one.gates:
            say(f"damperfit: {one.owner or 'logs'}: {gate}")
    n_before = sum(one.n_failures for one in done) - len(lines)
    if n_before and not is_quiet:
        count = "1 failure" if n_before == 1 else f"{n_before} failures"
        verb, them = ("counts", "it") if n_before == 1 else ("count", "them")
        say(f"damperfit: {count} of an earlier run {verb} too; the parts hold {them}")
    if found.is_stopped:
        left = n_tasks - len(done)
        say(
            f"damperfit: interrupted; {left} of {n_tasks} dampers left, the same command goes on "
            "with them"
        )
    elif n_tasks and not is_quiet:
        say(f"damperfit: parts in {out}")


def _summary(found: FleetDone) -> list[str]:
    done, n_tasks, counts = found.done, found.n_tasks, found.counts
    words = {
        "fitted": "fitted now",
        "known": "done before",
        "failed": "without any fit",
        "later": "not done, tried again next time",
    }
    parts = [
        f"{counts[key]} {said}" for key, said in words.items() if counts[key] or key == "fitted"
    ]
    n_settings = sum(one.n_settings for one in done)
    n_logs = sum(one.n_logs for one in done)
    dampers = f"{n_tasks} damper{'' if n_tasks == 1 else 's'}"
    return [f"{dampers}: {', '.join(parts)}; {n_logs} logs, {n_settings} settings with a fit"]
