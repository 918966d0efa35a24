"""Is each named limit of the package held, just inside and just outside?

`python -m tests.limits` moves each limit up and down by a little (a tenth; whole numbers up to a
hundred by one) and runs the tests that held.toml names for it: with the limit raised, and with it
lowered, one must fail. It is moved in memory, in one process for all; where no test notices that,
and with --copies for all, in a copy of the tree. What none notices is told, and the exit code is 1.

`python -m tests.limits --seek` looks for tests of limits that held.toml does not have, among those
that run the lines which read the limit (see tests/README.md, Mutations), the fastest first.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from tests.limits.finding import Limit
from tests.limits.in_memory import Move, noticed_in_memory
from tests.limits.table import HELD, Held, limits_of, read_table
from tests.mutations.__main__ import traced
from tests.mutations.mutants import Mutant
from tests.mutations.running import Result, Workspace, preload, run_mutants, run_tests
from tests.mutations.selection import Plan

ROOT = Path(__file__).parents[2]
_STEP = 1.1
_COUNTED = 100  # whole numbers up to here are moved by one
_SECONDS = 60.0  # that a test may take before it counts as hanging, a fourth


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options(arguments)
    table = read_table(HELD)
    limits = limits_of(ROOT, table)
    chosen = {
        name: limit
        for name, limit in limits.items()
        if not options.names or any(one in name for one in options.names)
    }
    folder = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if options.seek:
        known = table.held.keys() | table.exempt.keys()
        names = [name for name in chosen if not {name, name.partition("[")[0]} & known]
        return _seek({name: chosen[name] for name in sorted(names)}, folder, options)
    return _hold({name: chosen[name] for name in chosen if name in table.held}, table.held, options)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.limits",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("names", nargs="*", help="only limits whose name contains one of these")
    add("--seek", action="store_true", help="look for tests of limits that have none in the table")
    add("--copies", action="store_true", help="move all of them in copies of the tree")
    add("--jobs", type=int, default=2, help="limits at a time")
    add("--budget", type=float, default=20.0, help="with --seek: seconds of tests a limit")
    add("--folder", type=Path, default=ROOT / "build" / "mutations", help="for copies of the tree")
    return parser.parse_args(arguments)


def moved(limit: Limit, step: float = _STEP) -> tuple[float, float]:
    """Return the limit's value just above and just below."""
    if isinstance(limit.value, int):
        if abs(limit.value) <= _COUNTED and step == _STEP:
            return limit.value + 1, limit.value - 1
        return round(limit.value * step), round(limit.value / step)
    ends = limit.value * step, limit.value / step
    return max(ends), min(ends)


def _mutant(limit: Limit, value: float, kind: str) -> Mutant:
    text = (ROOT / limit.path).read_text(encoding="utf-8")
    return Mutant(
        key=f"{limit.name} {kind}",
        target="limits",
        kind=kind,
        path=limit.path,
        line=limit.line,
        last_line=limit.last_line,
        before=str(limit.value),
        after=str(value),
        text=limit.with_value(text, value),
    )


def _both(limit: Limit, step: float = _STEP) -> Iterator[Mutant]:
    for kind, value in zip(("raised", "lowered"), moved(limit, step), strict=True):
        yield _mutant(limit, value, kind)


def _spaces(folder: Path, jobs: int) -> list[Workspace]:
    preload()
    return [Workspace(ROOT, folder / f"limits{k}").make() for k in range(jobs)]


def _hold(limits: Mapping[str, Limit], held: Mapping[str, Held], options) -> int:
    mutants = {name: list(_both(limit, held[name].by or _STEP)) for name, limit in limits.items()}
    work = [
        (mutant, Plan(((getattr(held[name], mutant.kind), _SECONDS),)))
        for name, both in mutants.items()
        for mutant in both
    ]
    left = work if options.copies else _unnoticed(limits, held, work)
    unheld = 0
    for mutant, result in _in_copies(left, options):
        if result.status != "killed":
            unheld += 1
            name = mutant.key.rpartition(" ")[0]
            test = getattr(held[name], mutant.kind)
            print(f"{name}: {mutant.before} {mutant.kind} to {mutant.after}: {test} passes")
    print(f"{len(limits)} limits moved up and down; {len(work) - unheld} of {len(work)} noticed")
    return int(unheld > 0)


def _unnoticed(
    limits: Mapping[str, Limit], held: Mapping[str, Held], work: Sequence[tuple[Mutant, Plan]]
) -> list[tuple[Mutant, Plan]]:
    """Return what no test notices when it is moved in memory; a process of its own looks."""
    moves: list[Move] = []
    for name, limit in limits.items():
        values = moved(limit, held[name].by or _STEP)
        moves += zip((limit, limit), values, (held[name].raised, held[name].lowered), strict=True)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        noticed, failing = pool.submit(noticed_in_memory, ROOT, moves).result()
    for test in sorted(failing):
        print(f"without any change: {test} fails")
    return [one for one, is_noticed in zip(work, noticed, strict=True) if not is_noticed]


def _in_copies(work: Sequence[tuple[Mutant, Plan]], options) -> Iterator[tuple[Mutant, Result]]:
    if not work:
        return
    spaces = _spaces(options.folder.resolve(), options.jobs)
    tests = sorted({name for _, plan in work for name, _ in plan.tests})
    told = run_tests(spaces[0].folder, tests, _SECONDS * 10)
    if told:
        raise SystemExit(f"without any change: {told}")
    yield from run_mutants(spaces, work, budget=2.0 * _SECONDS)


def _seek(limits: Mapping[str, Limit], folder: Path, options) -> int:
    options.fresh = False
    selection = traced(ROOT, folder, options)
    spaces = _spaces(folder, options.jobs)
    work = [
        (mutant, selection.plan(mutant.path, mutant.line, mutant.last_line))
        for limit in limits.values()
        for mutant in _both(limit)
    ]
    silent = 0
    for mutant, result in run_mutants(spaces, work, budget=options.budget):
        silent += result.status != "killed"
        print(f"{mutant.key}\t{result.status}\t{result.killer}\t{result.seconds}", flush=True)
    return int(silent > 0)


if __name__ == "__main__":
    sys.exit(main())
