"""How much of what may be wrong do the tests notice? `python -m tests.mutations --help`."""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from tests.mutations.blocks import FOLDER, instrument
from tests.mutations.mutants import TARGETS, Mutant, draw, known_mutants
from tests.mutations.running import PLUGINS, Result, Workspace, preload, run_mutants, run_tests
from tests.mutations.selection import Selection, Trace

ROOT = Path(__file__).parents[2]
# The harness itself would be traced by itself; the others run C, and a browser over a page.
_NOT_TRACED = ("tests/mutations", "tests/core_sanitizers", "tests/test_report_browser.py")
Targets = Mapping[str, Sequence[str]]


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options(arguments)
    folder = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    _say(f"work is kept in {folder}; a run that is cut short goes on from there")
    root = options.root.resolve()
    targets = TARGETS if root == ROOT else {"all": ("damperfit",)}
    mutants = known_mutants(root) if options.known else _drawn(root, folder, targets, options)
    names = options.only.split(",") if options.only else []
    wanted = [one for name in names for one in mutants if name in {one.target, one.kind}]
    wanted = wanted if names else mutants
    if options.list:
        for mutant in wanted:
            print(f"{mutant.place} {mutant.function} {mutant.kind}")
            print(f"  - {mutant.before}\n  + {mutant.after}")
        return 0
    selection = traced(root, folder, options)
    results = _run(wanted, selection, folder, options)
    _report(wanted, results, is_known=options.known)
    survivors = [one for one in wanted if _survives(results[one.key])]
    share = len(survivors) / max(len(wanted), 1)
    limit = 0.0 if options.known else options.at_most / 100.0
    return int(share > limit)


def _drawn(root: Path, folder: Path, targets: Targets, options: argparse.Namespace) -> list[Mutant]:
    """Return the draw; kept, for it takes its time, until package or operators change."""
    said = [str((options.count, options.seed, sorted(targets)))]
    for place in (root / "damperfit", Path(__file__).parent):
        said += [path.read_text(encoding="utf-8") for path in sorted(place.rglob("*.py"))]
    said.append((Path(__file__).parent / "equivalent.toml").read_text(encoding="utf-8"))
    kept = folder / f"drawn-{_sum(''.join(said))}.json"
    if kept.exists():
        return [Mutant(**row) for row in json.loads(kept.read_text(encoding="utf-8"))]
    found = draw(root, options.count, options.seed, targets)
    kept.write_text(json.dumps([asdict(one) for one in found]), encoding="utf-8")
    return found


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutations", description=__doc__)
    add = parser.add_argument
    add("--count", type=int, default=320, help="mutants to draw")
    add("--seed", type=int, default=2000, help="of the draw; the same seed draws the same mutants")
    add(
        "--known", action="store_true", help="the mutants of known.toml instead: all must be caught"
    )
    add(
        "--only",
        default="",
        help="packages, kinds or names of known mutants, by comma, in this order",
    )
    add("--jobs", type=int, default=max(1, (os.cpu_count() or 2) - 1), help="mutants at a time")
    add(
        "--budget", type=float, default=60.0, help="seconds of tests a mutant; more count as silent"
    )
    add("--at-most", type=float, default=8.0, help="per cent that may survive before the code is 1")
    add("--fresh", action="store_true", help="forget earlier results")
    add("--again", action="store_true", help="try the survivors of earlier runs again")
    add("--list", action="store_true", help="name the mutants and run none")
    add("--folder", type=Path, default=ROOT / "build" / "mutations", help="for traces and results")
    add("--root", type=Path, default=ROOT, help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def traced(root: Path, folder: Path, options: argparse.Namespace) -> Selection:
    """Return which tests run which line, from a traced run of the suite.

    Traced again are the test files that changed since; lines of the package are followed through
    changes, so that an edit costs no new trace. A fresh run traces everything anew.
    """
    place = folder / "traces"
    if options.fresh:
        shutil.rmtree(place, ignore_errors=True)
    now = _hashes(root / "tests")
    seen: dict[str, str] = {}
    kept = sorted(one for one in place.glob("[0-9]*") if (one / "tests.json").exists())
    for one in kept:
        seen |= json.loads((one / "tests.json").read_text(encoding="utf-8"))
    changed = [
        name
        for name, value in now.items()
        if seen.get(name) != value and Path(name).name.startswith("test_")
    ]
    if changed or not kept:
        one = place / f"{len(kept):03d}"
        _trace(root, one, changed if kept else [], options.jobs)
        (one / "tests.json").write_text(json.dumps(now), encoding="utf-8")
        kept.append(one)
    return Selection(root, [Trace(one) for one in kept])


def _hashes(folder: Path) -> dict[str, str]:
    """Return what each file says, but for its imports: a module that moves changes no test."""

    def said(path: Path) -> str:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        tree.body = [one for one in tree.body if not isinstance(one, ast.Import | ast.ImportFrom)]
        return _sum(ast.dump(tree))

    return {
        path.relative_to(folder.parent).as_posix(): said(path)
        for path in sorted(folder.rglob("*.py"))
        if "mutations" not in path.relative_to(folder).parts
    }


def _trace(root: Path, place: Path, files: Sequence[str], jobs: int) -> None:
    """Run tests with every line traced, in a copy of the tree."""
    began = time.monotonic()
    _say(f"tracing {', '.join(files) or 'the suite'}")
    tree = Workspace(root, place / "tree").make().folder
    instrument(tree, place)
    path = os.pathsep.join([str(tree), str(ROOT)])  # the last for this plugin, in a toy tree
    environment = {**os.environ, FOLDER: str(place), "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # or conftest.py compiles it all anew
    command = [sys.executable, "-m", "pytest", "-p", "tests.mutations.tracing", "-q", *files]
    command += [f"-n{jobs if jobs > 1 else 0}", "--dist=loadfile", "--tb=line"]
    command += ["-p", "no:cacheprovider", *(f"--ignore={name}" for name in _NOT_TRACED)]
    done = subprocess.run(command, cwd=tree, env=environment, check=False, stdout=sys.stderr)
    if done.returncode not in {0, 1}:
        raise SystemExit(f"tests.mutations: the suite ended with {done.returncode}")
    collect(place)
    _say(f"traced in {time.monotonic() - began:.0f} s")


def collect(place: Path) -> None:
    """Join what the processes of a trace left behind."""
    times: dict[str, dict[str, object]] = {"tests": {}, "fixtures": {}, "uses": {}}
    for path in place.glob("times.*.json"):
        for name, found in json.loads(path.read_text(encoding="utf-8")).items():
            for key, value in found.items():
                before = times[name].get(key, []) if name == "uses" else []
                times[name][key] = sorted({*before, *value}) if name == "uses" else value
        path.unlink()
    hits: dict[str, set[int]] = defaultdict(set)
    for path in place.glob("hits.*.json"):
        for name, found in json.loads(path.read_text(encoding="utf-8")).items():
            hits[name].update(found)
        path.unlink()
    if not hits:
        raise SystemExit(f"tests.mutations: nothing was counted; what is compiled in {place}?")
    whole = {name: sorted(found) for name, found in sorted(hits.items())}
    (place / "hits.json").write_text(json.dumps(whole), encoding="utf-8")
    (place / "times.json").write_text(json.dumps(times), encoding="utf-8")


def _run(
    mutants: list[Mutant], selection: Selection, folder: Path, options: argparse.Namespace
) -> dict[str, Result]:
    log = folder / "results.jsonl"
    results = {} if options.fresh else _earlier(log, mutants, selection)
    if options.again:
        results = {key: one for key, one in results.items() if not _survives(one)}
    waiting = [one for one in mutants if one.key not in results]
    preload(*(() if selection.root == ROOT else (PLUGINS,)))
    spaces = [Workspace(selection.root, folder / f"space{k}").make() for k in range(options.jobs)]
    work = ((one, selection.plan(one.path, one.line, one.last_line)) for one in waiting)
    began = time.monotonic()
    with log.open("w" if options.fresh else "a", encoding="utf-8") as file:
        for mutant, result in run_mutants(spaces, work, budget=options.budget):
            results[mutant.key] = result
            file.write(json.dumps({**asdict(result), "text": _sum(mutant.text)}) + "\n")
            file.flush()
            if _survives(result):
                _say(f"{result.status}: {mutant.place} {mutant.kind}: {mutant.after}")
        spent = time.monotonic() - began
        _say(f"{len(waiting)} mutants tried in {spent:.0f} s, {len(results)} known")
        wrong = _false_alarms(results, spaces[0], selection)
        for key in [key for key, one in results.items() if one.killer in wrong]:
            results[key] = replace(results[key], status="survived")
            text = next(_sum(one.text) for one in mutants if one.key == key)
            file.write(json.dumps({**asdict(results[key]), "text": text}) + "\n")
    return results


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _earlier(log: Path, mutants: list[Mutant], selection: Selection) -> dict[str, Result]:
    """Return what is known of mutants whose file, and whose killer, are still there."""
    if not log.exists():
        return {}
    known = {}
    for line in log.read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        text = row.pop("text")
        known[row["key"], text] = Result(**row)
    found = {one.key: known.get((one.key, _sum(one.text))) for one in mutants}
    return {
        key: one
        for key, one in found.items()
        if one is not None and ("::" not in one.killer or one.killer in selection.tests)
    }


def _false_alarms(results, space: Workspace, selection: Selection) -> set[str]:
    """Return the killers that fail without a mutant, too; each is run once more."""
    killers = sorted({one.killer for one in results.values() if one.killer in selection.tests})
    wrong: set[str] = set()
    while killers:
        seconds = sum(selection.tests[name]["seconds"] for name in killers)
        told = run_tests(space.folder, killers, 2.0 * seconds)
        if not told:
            break
        if told not in killers:
            raise SystemExit(f"tests.mutations: the killers alone ended with: {told}")
        _say(f"{told} fails without a mutant: what it killed counts as alive")
        wrong.add(told)
        killers.remove(told)
    return wrong


def _survives(result: Result) -> bool:
    return result.status in {"survived", "unseen"}


def _report(mutants: list[Mutant], results: dict[str, Result], *, is_known: bool) -> None:
    survivors = [one for one in mutants if _survives(results[one.key])]
    for mutant in survivors:
        found = results[mutant.key]
        note = "  (no test runs it)" if found.status == "unseen" else ""
        note = f"  (not run for want of time: {found.cut} tests)" if found.cut else note
        print(f"{mutant.place}  {mutant.kind}{note}\n  - {mutant.before}\n  + {mutant.after}")
    if is_known:
        print(f"{len(mutants) - len(survivors)} of {len(mutants)} known mutants are caught")
        return
    drawn, alive = Counter(one.target for one in mutants), Counter(one.target for one in survivors)
    print(f"\n{'package':16}{'mutants':>8}{'survive':>8}{'%':>7}")
    for target in drawn:
        share = 100.0 * alive[target] / drawn[target]
        print(f"{target:16}{drawn[target]:8}{alive[target]:8}{share:7.1f}")
    share = 100.0 * len(survivors) / max(len(mutants), 1)
    print(f"{'all':16}{len(mutants):8}{len(survivors):8}{share:7.1f}")
    n_cut = sum(results[one.key].cut > 0 for one in survivors)
    print(f"of those that survive, the budget cut the tests of {n_cut}")


if __name__ == "__main__":
    sys.exit(main())
