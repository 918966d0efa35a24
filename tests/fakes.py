"""Small hand-made campaigns for tests of tables and reports: no fit, no file, known numbers."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa

from damperfit.damper.cylinder import Cavitation
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.identification import Campaign, Fit, LogFit, Outcome, Status
from damperfit.problem import Failure, Problem
from damperfit.recording import Drive, FilterDesign, Segment, Trace
from damperfit.results import Run
from damperfit.simulation import SolverOptions
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tables.files import lay_out
from damperfit.tables.rows import campaign_rows

FREE = ("r_m1", "r_m2", "k_e")


def trace(setting: int, name: str | None = None) -> Trace:
    """Return three cycles of a sine at 1.5 Hz, 500 Hz; the middle cycle and a half are steady."""
    n = 1000
    time = np.arange(n) / 500.0
    x = 0.032 * np.sin(2 * np.pi * 1.5 * time)
    v = 0.032 * 2 * np.pi * 1.5 * np.cos(2 * np.pi * 1.5 * time)
    return Trace(
        name=name or f"setting_{setting:02d}.csv",
        setting=setting,
        start_time=10.0,
        interval=1.0 / 500.0,
        displacement=x,
        velocity=v,
        force=2500.0 * v - 130.0,
        drive=Drive(x, v, np.inf),
        segments=(
            Segment(
                kind="steady",
                first=333,
                stop=666,
                cycle_starts=np.array([333.0, 666.3]),
                frequency=1.5,
                amplitude=0.032,
                peak_speed=float(np.abs(v[333:666]).max()),
            ),
        ),
        centre=0.0,
        n_cycles_found=3,
        model_filter=FilterDesign(np.empty((0, 6)), is_zero_phase=False, description="no filter"),
        temperature=26.0,
    )


def fit(
    setting: int,
    *,
    mse: float = 0.0123,
    outcome: Outcome = Outcome.CONVERGED,
    status: dict[str, str] | None = None,
    f_0: float = 0.0,
    logs: tuple[str, ...] = (),
) -> Fit:
    """Return a fit with round numbers."""
    names = logs or (f"setting_{setting:02d}.csv",)
    plain = {name: "fitted" if name in FREE else "shared" for name in PURDY_DAMPER.names}
    named = plain | {"f_0": "fixed"} | (status or {})
    return Fit(
        setting=setting,
        parameters=Parameters(
            r_m1=1.4e4 + 700.0 * setting,
            r_m2=2.0e6 * 1.1**setting,
            r_m3=2.597e6,
            k_e=5.0e8 + 1e7 * setting,
            f_f=50.0,
            f_0=f_0,
        ),
        status={name: Status(word) for name, word in named.items()},
        outcome=outcome,
        mse_percent=mse,
        noise_floor_percent=0.01,
        n_samples=333 * len(names),
        n_cycles=len(names),
        evaluations=12,
        cavitation=Cavitation(fraction=0.05, lowest_pressure=0.0, chamber=2)
        if outcome is Outcome.CAVITATING
        else Cavitation(0.0, 7e4, 2, 0.001, 0.3, 0.176, 3.9e5),
        logs=tuple(LogFit(trace(setting, name), mse, 0.01) for name in names),
    )


def campaign(*fits: Fit, **more: object) -> Campaign:
    """Return a campaign of these fits."""
    quantities = {"quantities": fits[0].parameters.quantities} if fits else {}
    return Campaign(procedure="paper", fits=fits, **{**quantities, **more})  # type: ignore[arg-type]


def make_tables(done: Campaign, *, facts: object = None, **how: object) -> dict[str, pa.Table]:
    """Return the tables of a campaign as they are written."""
    rows = campaign_rows(done, **how)  # type: ignore[arg-type]
    layout: Any = {"settings": [row["setting"] for row in rows["parameters"]], "facts": facts}
    layout["quantities"] = done.quantities or PAPER_QUANTITIES
    return {name: lay_out(name, of, **layout) for name, of in rows.items()}


def changed(run, *, record=None, signals=None, **rows):
    """Return a run with another record, other signals or other rows of tables."""
    tables = ("parameters", "mse", "valves", "characteristics")
    known = {name: run.rows(name) for name in tables} | rows
    return Run(
        run.record if record is None else record,
        known,
        quantities=run.quantities,
        signals=run.signals if signals is None else signals,
        remarks=run.remarks,
    )


def values_in(place):
    """Return the values of each setting of a run or table."""
    return {one.setting: one.values for one in Run.load(place).settings}


def fitted_run(damper, stages, motion, forces, rows, quantities, solver=SolverOptions()):
    """Return a run that says what it is told of its settings, motion and measured forces."""
    known = [{**row, "setting": setting} for setting, row in rows.items()]
    run = Run({}, {"parameters": known}, quantities=quantities)
    simulation = SimpleNamespace(solver=solver)
    told = SimpleNamespace(damper=damper, simulation=simulation)
    vars(run).update(settings=tuple(stages), motion=motion, speed_forces=tuple(forces))
    vars(run).update(configuration=told)
    return run


def run_of(stages, damper, sine, measured=()):
    """Return a run that has settings alone."""
    quantities = stages[0].parameters.quantities
    return fitted_run(damper, tuple(stages), sine, measured, {}, quantities)


def failed(log, path, setting, kind, message, code="log"):
    """Return a failure with its sentence."""
    text = message.removeprefix(f"{log}: ") if log else message.removeprefix(f"setting {setting}: ")
    subject = message[: len(message) - len(text)].removesuffix(": ")
    return Failure(Problem(code, text, subject=subject), kind, log, path, setting)


def log_text(time, displacement, force, *facts: str) -> str:
    """Return what a rig writes of these signals, s, m, N, below facts such as "setting: 3"."""
    rows = zip(time, 1e3 * displacement, force, strict=True)
    lines = [*(f"# {fact}" for fact in facts), "time_s,displacement_mm,force_N"]
    return "\n".join([*lines, *(f"{t:.4f},{x:.5f},{f:.3f}" for t, x, f in rows)]) + "\n"
