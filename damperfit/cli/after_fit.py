"""Commands of what follows a fit: each calls its function and prints what comes back."""

from __future__ import annotations

from threading import Event
from typing import Any

from damperfit.after_fit import functions
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines, print_table, say, wrapped
from damperfit.cli.watching import stop_on_signal

__all__ = ["advise", "passport", "ride", "valves", "watch"]


@command(functions.advise)
def advise(how: Shown, **given: Any) -> int:
    """Say which further test narrows an interval most.

    Example: damperfit advise results --for k_e --max-stroke 40mm
    """
    advice = functions.advise(**given)
    if how.json:
        print_json(advice.document())
        return 0
    print_lines(wrapped(advice.sentence))
    if advice.tests and not how.quiet:
        print_lines([""])
        print_table(advice.sheet())
    return 0


@command(functions.valves)
def valves(how: Shown, **given: Any) -> int:
    """Show the valves as parts: holes in mm, preloads in bar and N, and where a click jumps.

    Example: damperfit valves results --cd 0.7
    """
    found = functions.valves(**given)
    if how.json:
        print_json(found.document())
        return 0
    for sheet in found.sheets():
        if sheet.rows:
            print_table(sheet)
    for remark in found.remarks:
        say(f"note: {remark}")
    return 0


@command(functions.passport)
def passport(how: Shown, **given: Any) -> int:
    """Write the passport of a damper: one A4 page, and a JSON that compare takes as a baseline.

    Example: damperfit passport results --out passports
    """
    files = functions.passport(**given)
    if how.json:
        print_json({"files": [str(path) for path in files]})
    elif not how.quiet:
        say(f"damperfit: {files[0]} and {files[1]} written")
    return 0


@command(functions.ride)
def ride(how: Shown, **given: Any) -> int:
    """Show comfort and wheel load of each setting on a road, or its work along a measured stroke.

    Example: damperfit ride results --car car.toml
    """
    found = functions.ride(**given)
    if how.json:
        print_json(found.document())
        return 0
    print_lines(wrapped(found.sentence))
    if not how.quiet:
        print_lines([""])
        print_table(found.sheet())
    return 0


@command(functions.watch, shown=("json", "quiet", "debug", "version"))
def watch(how: Shown, **given: Any) -> int:
    """Fit each log as soon as it is complete, and answer in one line; Ctrl-C ends it.

    Example: damperfit watch runs --out results --reference before
    """
    stop = Event()
    arrivals = functions.watch(**given, stop=stop)
    if not how.quiet:
        say(f"damperfit: watching {given['folder']}; Ctrl-C ends it")
    with stop_on_signal("the results will be written", stop):
        for arrival in arrivals:
            if how.json:
                print_json({"log": str(arrival.path), "sentence": arrival.sentence})
            else:
                print_lines([arrival.sentence])
    return 0
