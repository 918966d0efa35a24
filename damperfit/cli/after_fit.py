"""Commands of what follows a fit: each calls its function and prints what comes back."""

from __future__ import annotations

import json
from functools import partial
from threading import Event
from typing import Any

from damperfit.after_fit import functions
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines, print_table, say, wrapped
from damperfit.cli.watching import stop_on_signal


def _answer(function: Any, how: Shown, **given: Any) -> int:
    """Print the sentence, the tables and the remarks of an answer."""
    answer = function(**given)
    if how.json:
        print_json(answer.document())
        return 0
    if answer.sentence:
        print_lines(wrapped(answer.sentence))
    is_short = how.quiet and answer.sentence
    for k, sheet in enumerate(() if is_short else [one for one in answer.sheets() if one.rows]):
        if k or answer.sentence:
            print_lines([""])
        print_table(sheet)
    for remark in answer.remarks:
        say(f"note: {remark}")
    return 0


def _answering(function: Any, example: str) -> Any:
    return command(function, example=example)(partial(_answer, function))


advise = _answering(functions.advise, "advise results --for k_e --max-stroke 40mm")
valves = _answering(functions.valves, "valves results --cd 0.7")
ride = _answering(functions.ride, "ride results --car car.toml")


@command(functions.passport, example="passport results --out passports")
def passport(how: Shown, **given: Any) -> int:
    """Say where the passport stands."""
    files = functions.passport(**given)
    if how.json:
        print_json({"files": [str(path) for path in files]})
    elif not how.quiet:
        say(f"damperfit: {files[0]} and {files[1]} written")
    return 0


@command(functions.watch, example="watch runs --out results --reference before")
def watch(how: Shown, **given: Any) -> int:
    """Print a line for each log, with --json a document of one line."""
    stop = Event()
    arrivals = functions.watch(**given, stop=stop)
    if not how.quiet:
        say(f"damperfit: watching {given['folder']}; Ctrl-C ends it")
    with stop_on_signal("the results will be written", stop):
        for arrival in arrivals:
            line = json.dumps(arrival.document(), ensure_ascii=False) if how.json else ""
            print_lines([line or arrival.sentence])
    return 0
