"""What is lost without a piece of the program: the table of `bench_numbers` with the piece off.

    python -m tests.ablation                          # the pieces
    python -m tests.ablation NAME ... --only valves   # these off, together
    python -m tests.ablation NAME --run tests.laws.rates --dampers 6

A piece is switched off by replacing one function. `ablation.toml` keeps what was measured: the
piece, on which data, what is lost without it. A step of a fit or a search stays in the program only
with a row there that shows a loss that a user would see.
"""

import argparse
import importlib
import runpy
import sys
from typing import Any
from unittest import mock

from damperfit.damper.valve_dampers import ValveDamper
from damperfit.identification import procedures
from damperfit.laws import criterion, search, structure_fits, structures
from tests.bench_numbers import CASES, compared, load_frozen

_WITH_PART = structures.with_part
_FITS = structure_fits.StructureFits
_FOLLOWED, _STARTS, _EXTENDED = search._Search.followed, _FITS.starts, _FITS.extended
_TAKE_FRICTION = procedures._Stages._take_friction


def _first(given: Any, *_: Any, **__: Any) -> Any:
    return given


def _one_start(*given: Any) -> Any:
    return {"full": _STARTS(*given)["full"]}


def _sound(paper: Any, r_m3: float | None) -> None:
    known, judged = paper.fits, procedures._is_good
    paper.fits = {setting: one for setting, one in known.items() if judged(one)}
    _TAKE_FRICTION(paper, r_m3)
    paper.fits = known


def _nothing_on_top(*given: Any) -> Any:
    with mock.patch.object(search, "moves", return_value={}):
        return _FOLLOWED(*given)


def _from_neighbours_alone(*given: Any) -> Any:
    with mock.patch.object(ValveDamper, "start", return_value=()):
        return _EXTENDED(*given)


def _without_rubber(damper: Any, name: str) -> Any:
    return damper if name == "rubber" else _WITH_PART(damper, name)


# By name: module, what is replaced (a class's function as Class.name), and by what.
PIECES: dict[str, tuple[str, str, Any]] = {
    # The search over structures.
    "layouts again": ("laws.search", "_Search.in_its_layout", lambda _, fit, __: fit),
    "held out": ("laws.criterion", "Criterion.of_held_out", lambda *_: 0.0),
    "believed friction": ("identification.fit_problem", "_UNBELIEVED", 0.0),
    "yielding": ("laws.search", "_Search.yielding", lambda _, law, *__: law),
    "ties by the logs": ("laws.search", "_Search.with_ties", lambda *_: None),
    "believed defaults": ("laws.criterion", "_FREED", 1e9),
    "floor of the criterion": ("laws.criterion", "FLOOR_PERCENT", 0.001),
    "on top of the best": ("laws.search", "_Search.followed", _nothing_on_top),
    "starts at more settings": (
        "laws.structure_fits",
        "StructureFits.extended",
        _from_neighbours_alone,
    ),
    "starts of a valve": ("damper.valve_dampers", "_GUESSES", ()),
    "second look": ("laws.search", "LOOK", criterion.ONE),
    "rubber": ("laws.structures", "with_part", _without_rubber),
    "ties of parts": ("laws.structures", "Structure.ties_of", lambda _, other: other.ties),
    "hopeless valves": ("laws.search", "_Search.is_hopeless", lambda *_: False),
    "more starts of a move": ("laws.structure_fits", "StructureFits.starts", _one_start),
    "determined values": ("laws.criterion", "LinearisedTies.is_shown", lambda *_: True),
    # Errors.
    "refilling": ("uncertainty.covariance", "_slopes", lambda _, seen: seen.sensitivities),
    "linearised on cycles": ("identification.logs", "LogFit.cycles", ()),
    # Fits.
    "corners": ("identification.logs", "_counted", lambda _: None),
    "mean friction": ("identification.procedures", "_with_mean_friction", lambda _, fit, *__: fit),
    "frictions of unsound fits": ("identification.procedures", "_Stages._take_friction", _sound),
    "contradicted R_m3": ("identification.procedures", "_is_contradicted", lambda *_: False),
    "first beta": ("identification.procedures", "_with_first_beta", lambda _, given, __: given),
    "clip": ("identification.fit_problem", "Block.stays_beyond", property(lambda _: False)),
    "idle parts": ("identification.procedures", "_without_idle_parts", _first),
    "last step": ("identification.fit_setting", "_last_step", lambda *_: None),
    "further_starts": ("damper.purdy.parameters", "Damper.further_starts", lambda *_: ()),
    "starts in turn": ("identification.fit_setting", "_in_turn", lambda _, ranked: ranked),
    "lost valve": ("identification.fit_setting", "_lost_a_valve", lambda *_: False),
}


def switched_off(name: str) -> None:
    """Switch a piece off in this process."""
    module, path, instead = PIECES[name]
    owner: Any = importlib.import_module(f"damperfit.{module}")
    *classes, attribute = path.split(".")
    for one in classes:
        owner = getattr(owner, one)
    getattr(owner, attribute)  # it is there
    setattr(owner, attribute, instead)


def main() -> None:
    """Print the pieces, the table without some, or run a module without some."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="comma-separated or apart")
    parser.add_argument("--only", nargs="+", default=[""], help="beginnings of names of cases")
    parser.add_argument("--jobs", type=int, default=2, help="cases at once")
    parser.add_argument("--run", nargs=argparse.REMAINDER, help="a module and its arguments")
    given = parser.parse_args()
    names = [name for one in given.names for name in one.split(",")]
    unknown = [name for name in names if name not in PIECES]
    if unknown or not names:
        print("\n".join(PIECES))
        sys.exit(int(bool(unknown)))
    if given.run:
        for name in names:
            switched_off(name)
        sys.argv = given.run
        runpy.run_module(given.run[0], run_name="__main__", alter_sys=True)
        return
    cases = [case for case in CASES if case.name.startswith(tuple(given.only))]
    command = ("-m", "tests.ablation", ",".join(names), "--run", "damperfit")
    compared(cases, load_frozen(), command=command, jobs=given.jobs)


if __name__ == "__main__":
    main()
