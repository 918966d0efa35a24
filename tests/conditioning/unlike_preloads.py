"""How often logs of valves with unlike preloads are turned round: right ones, and reversed ones.

    python -m tests.conditioning.unlike_preloads              # 1500 dampers, a minute
    python -m tests.conditioning.unlike_preloads --without    # any doubt of such levels
    python -m tests.conditioning.unlike_preloads --tares --dampers 400

Preloads of 10 to 1000 N in either stroke lift the force at the reversals, as a gas force that is
counted the other way does. ``--tares`` tells how often logs are said to be tared: right ones, and
such without a gas force.
"""

import argparse
from dataclasses import replace

import numpy as np

from damperfit.conditioning import condition, polarity
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConditioningError
from tests.conditioning.logs import RATE, recording, sine

ATMOSPHERE = 101325.0  # the cell is zeroed before the damper is mounted


def drawn(random: np.random.Generator, declared):
    """Return displacement, force and what is declared of one damper, without noise."""
    frequency = random.choice([0.5, 1.0, 1.67, 2.5, 4.0, 6.0])
    amplitude = min(0.04, random.uniform(0.05, 0.8) / (2.0 * np.pi * frequency))
    pressure = ATMOSPHERE + random.uniform(20.0, 250.0) / declared.gas.rod_area
    gas = declared.gas._replace(pressure=pressure)
    x = sine(frequency, amplitude, max(6, int(6 * frequency)))
    v = np.gradient(x, 1.0 / RATE)
    strokes = []
    for sign in (1.0, -1.0):
        preload, within = 10.0 ** random.uniform(1.0, 3.0), 10.0 ** random.uniform(-3.0, -1.0)
        linear = 10.0 ** random.uniform(1.5, 3.3)
        square = random.uniform(0.0, 3000.0) * (random.random() < 0.5)
        strokes.append(preload * np.tanh(v / within) + linear * v + sign * square * v * v)
    force = np.where(v > 0.0, *strokes) + random.uniform(5.0, 60.0) * np.tanh(v / 1e-3)
    squeezed = gas.pressure * (gas.volume / (gas.volume + gas.rod_area * x)) ** gas.exponent
    return x, force - gas.rod_area * (squeezed - ATMOSPHERE), replace(declared, gas=gas)


def is_told(x, force, options, *, tare: bool) -> bool:
    """Whether a log is put right, or said to lack its gas force; one that is refused is neither."""
    try:
        trace = condition(recording(np.arange(len(x)) / RATE, x, force), options)
    except ConditioningError:
        return False
    if tare:
        return any(one.name == "tare" and one.severity == "warning" for one in trace.findings)
    return any(one.is_correction for one in trace.findings)


def main() -> None:
    """Print how many of the right logs are told something, and how many of the others."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--without", action="store_true", help="no doubt of preloads")
    parser.add_argument("--tares", action="store_true", help="count warnings of a tare instead")
    options = parser.parse_args()
    random, declared = np.random.default_rng(options.seed), load_configuration().conditioning
    if options.without:
        polarity._OF_HIDDEN = polarity._OF_PRELOADS = 0.0
        polarity.held_share = lambda _: 0.0
    right = wrong = 0
    for _ in range(options.dampers):
        x, force, known = drawn(random, declared)
        x = x + random.normal(0.0, 4e-6, len(x))
        force = force + random.normal(0.0, 3.0, len(x))
        gas = known.gas.rod_area * (known.gas.pressure - ATMOSPHERE)
        other = (x, force + gas) if options.tares else (-x, -force)
        right += is_told(x, force, known, tare=options.tares)
        wrong += is_told(*other, known, tare=options.tares)
    told, others = (
        ("told to be tared", "without their gas force")
        if options.tares
        else ("turned round", "reversed ones that are put right")
    )
    print(f"of {options.dampers} right logs {right} are {told}; of as many {others} {wrong}")


if __name__ == "__main__":
    main()
