"""Do fits of real valves end in the best known minimum? Made-up dampers of each topology.

    python -m tests.identification.convergence --dampers 10 --starts 20

Every damper has its own bleeds, openings, slopes, friction, mounting, and a log of three speeds
with 4 N and 8 um of noise at 1 kHz. It is fitted as `identify` does, from the true numbers, and
from random starts (every number times exp(N(0, 1))). The best known minimum is the lowest end of
all; an end within 2 % of its MSE has reached it.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import DamperfitError
from damperfit.identification import FitOptions, identify
from damperfit.identification.fit_problem import Block, kept_within
from damperfit.identification.fit_setting import minimised
from damperfit.identification.starts import fit_setting
from damperfit.recording import Recording
from damperfit.simulation import Motion, SolverOptions, simulate

if TYPE_CHECKING:
    from damperfit.damper.model import Values

__all__ = ["Outcome", "log_of", "made_up", "run_damper"]

KINDS = {"twin_tube": TwinTube, "monotube": Monotube, "through_flow": ThroughFlow}
PAPER = "purdy"
NAMED = {"opening": 3.0, "bleed": 2.0, "k_s": 5.0, "play": 10.0}  # the bars, per cent
SPEEDS, AMPLITUDE, RATE = (0.05, 0.13, 0.26), 0.02, 1000.0
SOLVER = SolverOptions(tolerance=1e-2)
REACHED = 1.02


@dataclass(frozen=True)
class Outcome:
    """What became of one damper: MSE of every end, and errors of what `identify` found."""

    best: float
    own: float
    random: tuple[float, ...]
    errors: dict[str, float]
    told: dict[str, bool]

    @property
    def share(self) -> float:
        """Of the random starts that reached the best known minimum."""
        return float(np.mean([one <= REACHED * self.best for one in self.random]))


def made_up(kind: str, seed: int, *, has_play: bool = False):
    """A damper of a topology and its numbers; the valves make 100 to 1500 N at the top speed.

    The paper's is at one of its settings, every number a fifth off.
    """
    noise = np.random.default_rng([seed, len(kind)])
    if kind == PAPER:
        values = reference_parameters(int(noise.integers(1, 20)))
        own = [one.name for one in values.quantities if one.is_logarithmic]
        numbers = {name: getattr(values, name) * math.exp(noise.normal(0.0, 0.2)) for name in own}
        return PURDY_DAMPER, values.replace(numbers)
    model = KINDS[kind](
        gas_pressure=2.5e6 if kind == "monotube" else 6e5,
        mounting=Mounting(FIT, FIT if has_play else NONE, NONE),
    )
    numbers = {"f_f": noise.uniform(8.0, 40.0), "f_0": noise.normal(0.0, 10.0)}
    for stroke, area in zip(("rebound", "compression"), model.pressed_areas, strict=True):
        most = noise.uniform(150.0, 1200.0) / area  # Pa at the top speed
        opening = most * noise.uniform(0.25, 0.7)
        through = area * SPEEDS[-1] * model.oil_density  # kg/s
        share = noise.uniform(0.05, 0.4)  # of the flow at the opening that the bleed carries
        numbers[f"{stroke}_opening"] = opening
        numbers[f"{stroke}_bleed"] = math.sqrt(opening) / (share * through)
        numbers[f"{stroke}_slope"] = (most - opening) / through
    numbers["k_s"] = math.exp(noise.uniform(math.log(1.25e5), math.log(1.5e6)))
    if has_play:
        numbers["play"] = noise.uniform(3e-4, 1.5e-3)
    return model, model.values(numbers)


def log_of(model, truth, seed: int):
    """Three speeds, four cycles each, swept in; 4 N and 8 um of noise."""
    rates = [np.zeros(round(0.2 * RATE))]
    last = 0.0
    for speed in SPEEDS:
        own = speed / (2 * math.pi * AMPLITUDE)
        rates += [
            np.linspace(last, own, round(0.4 * RATE)),
            np.full(round(4.3 / own * RATE), own),
        ]
        last = own
    phase = 2 * math.pi * np.cumsum(np.concatenate(rates)) / RATE
    x = AMPLITUDE * np.sin(phase)
    motion = Motion(1 / RATE, x, np.gradient(x, 1 / RATE))
    force = simulate(truth, model, motion, options=SOLVER).force
    noise = np.random.default_rng([seed, 1])
    recording = Recording(
        name=f"made_up_{seed}", path="", sha256="", setting=1, time=np.arange(len(x)) / RATE,
        displacement=x + noise.normal(0.0, 8e-6, len(x)),
        force=force + noise.normal(0.0, 4.0, len(x)),
    )  # fmt: skip
    return condition(recording, ConditionOptions())


def run_damper(kind: str, seed: int, n_starts: int, *, has_play: bool = False) -> Outcome:
    """Fit one damper from everywhere."""
    model, truth = made_up(kind, seed, has_play=has_play)
    trace = log_of(model, truth, seed)
    free = tuple(one.name for one in model.quantities if one.default is None)
    problem = Block(model, (trace,), free, SOLVER)
    (fit,) = identify([trace], model, FitOptions("plain", free=free, solver=SOLVER)).fits
    # With the weights of the stretches that the fits have, not those of the report.
    own = 100.0 * problem.cost(fit.parameters)
    ends = [minimised(problem, truth).mse_percent]
    noise = np.random.default_rng([seed, 2])
    for _ in range(n_starts):
        away = {
            name: getattr(truth, name) * math.exp(noise.normal())
            for name in free
            if model.quantity(name).is_logarithmic
        }
        start = kept_within(truth.replace(away, f_0=0.0), free)
        ends.append(_ended(problem, start))
    errors, told = {}, {}
    for name in free:
        bar = next((part for part in NAMED if name.endswith(part)), "")
        if bar:
            true = getattr(truth, name)
            errors[name] = 100 * abs(getattr(fit.parameters, name) / true - 1)
            told[name] = fit.status[name].value == "fitted"
    return Outcome(min(own, *ends), own, tuple(ends[1:]), errors, told)


def _ended(problem: Block, start: Values) -> float:
    """MSE where a fit from a start ends."""
    try:
        return fit_setting(problem, start).mse_percent
    except DamperfitError:
        return math.inf


def _line(kind: str, outcomes: list[Outcome]) -> str:
    own = sum(one.own <= REACHED * one.best for one in outcomes)
    some = sum(any(end <= REACHED * one.best for end in one.random) for one in outcomes)
    share = 100 * np.mean([one.share for one in outcomes])
    return (
        f"{kind}: best known minimum reached by identify in {own} of {len(outcomes)} dampers, by "
        f"the best of the random starts in {some}, by {share:.0f} % of the random starts"
    )


def _errors(outcomes: list[Outcome]) -> list[str]:
    said = []
    for part, bar in NAMED.items():
        found = [
            (error, one.told[name])
            for one in outcomes
            for name, error in one.errors.items()
            if name.endswith(part)
        ]
        if found:
            errors = [error for error, is_reported in found if is_reported]
            within = sum(error <= bar for error in errors)
            said.append(
                f"  {part}: {within} of {len(errors)} told within {bar:g} %, worst "
                f"{max(errors, default=math.nan):.1f} %, median {np.median(errors):.2f} %"
            )
    return said


def main() -> None:
    """Print a line for each topology."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=10, help="of each topology")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--starts", type=int, default=20, help="random starts a damper")
    parser.add_argument("--topology", choices=(*KINDS, PAPER), action="append")
    parser.add_argument("--play", action="store_true", help="joints with play")
    given = parser.parse_args()
    for kind in given.topology or (*KINDS, PAPER):
        outcomes = []
        for seed in range(given.first, given.first + given.dampers):
            one = run_damper(kind, seed, given.starts, has_play=given.play)
            outcomes.append(one)
            said = f"{kind} {seed}: identify {one.own:.4g} %, best {one.best:.4g} %"
            print(f"{said}, {100 * one.share:.0f} % of the random starts", flush=True)
        print("\n".join([_line(kind, outcomes), *_errors(outcomes)]), flush=True)


if __name__ == "__main__":
    main()
