"""Do fits of real valves end in the best known minimum? Made-up dampers of each topology.

    python -m tests.identification.convergence --dampers 10 --starts 20

Every damper has its own bleeds, openings, slopes, friction, mounting, and a log of three speeds
with 4 N and 8 um of noise at 1 kHz. It is fitted as `identify` does, from the true numbers, and
from random starts (every number times exp(N(0, 1))). The best known minimum is the lowest end of
all; an end within 2 % of its MSE has reached it.
"""

import argparse
import math

import numpy as np

from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import DamperfitError
from damperfit.identification import FitOptions, identify
from damperfit.identification.fit_problem import Block, kept_within
from damperfit.identification.fit_setting import fit_setting, minimised
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.identification.rig import recorded

KINDS = {"twin_tube": TwinTube, "monotube": Monotube, "through_flow": ThroughFlow}
PAPER = "purdy"
SPEEDS, AMPLITUDE, RATE = (0.05, 0.13, 0.26), 0.02, 1000.0
SOLVER = SolverOptions(tolerance=1e-2)
REACHED = 1.02


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
    log = recorded(x, force, RATE, setting=1, noises=(8e-6, 4.0), seed=[seed, 1])
    return condition(log)


def run_damper(kind: str, seed: int, n_starts: int, *, has_play: bool = False):
    """MSE where `identify` ends, the true numbers lead and each random start does."""
    model, truth = made_up(kind, seed, has_play=has_play)
    trace = log_of(model, truth, seed)
    free = tuple(one.name for one in model.quantities if one.default is None)
    block = Block(model, (trace,), free, SOLVER)
    (fit,) = identify([trace], model, FitOptions("plain", free=free, solver=SOLVER)).fits
    # With the weights of the segments that the fits have, not those of the report.
    own, true = 100.0 * block.cost(fit.parameters), minimised(block, truth).mse_percent
    noise, ends = np.random.default_rng([seed, 2]), []
    positive = [name for name in free if model.quantity(name).is_logarithmic]
    for _ in range(n_starts):
        away = {name: getattr(truth, name) * math.exp(noise.normal()) for name in positive}
        start = kept_within(truth.replace(away, f_0=0.0), free)
        try:
            ends.append(fit_setting(block, start).mse_percent)
        except DamperfitError:
            ends.append(math.inf)
    return own, true, ends


def main() -> None:
    """Print a line for each damper and each topology."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=10, help="of each topology")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--starts", type=int, default=20, help="random starts a damper")
    parser.add_argument("--topology", choices=(*KINDS, PAPER), action="append")
    parser.add_argument("--play", action="store_true", help="joints with play")
    given = parser.parse_args()
    for kind in given.topology or (*KINDS, PAPER):
        reached, some, shares = 0, 0, []
        for seed in range(given.first, given.first + given.dampers):
            own, true, ends = run_damper(kind, seed, given.starts, has_play=given.play)
            best = min(own, true, *ends)
            share = 100 * float(np.mean([one <= REACHED * best for one in ends]))
            reached, some = reached + (own <= REACHED * best), some + (share > 0.0)
            shares.append(share)
            said = f"{kind} {seed}: identify {own:.4g} %, best {best:.4g} %"
            print(f"{said}, {share:.0f} % of the random starts", flush=True)
        print(
            f"{kind}: best known minimum reached by identify in {reached} of {given.dampers} "
            f"dampers, by the best of the random starts in {some}, by {np.mean(shares):.0f} % of "
            "the random starts",
            flush=True,
        )


if __name__ == "__main__":
    main()
