"""How often logs of valves with unlike preloads are turned round: right ones, and reversed ones.

    python -m tests.conditioning.unlike_preloads              # 1500 dampers, a minute
    python -m tests.conditioning.unlike_preloads --without
    python -m tests.conditioning.unlike_preloads --tares --dampers 400

Preloads of 10 to 1000 N in either stroke lift the force at the reversals, as a gas force that is
counted the other way does. ``--without`` tells what would be without doubt of such levels: without
`_OF_HIDDEN` and `_OF_PRELOADS` of `conditioning/polarity.py` and what it has as held.
``--tares`` tells how often logs are said to be tared: right ones, and such without a gas force.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from unittest.mock import patch

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


def is_turned(x, force, options) -> bool:
    """Whether a log is put right; one that is refused is not."""
    try:
        trace = condition(recording(np.arange(len(x)) / RATE, x, force), options)
    except ConditioningError:
        return False
    return any(one.is_correction for one in trace.findings)


def warns_of_tare(x, force, options) -> bool:
    """Whether a log is said to lack its gas force, or to have another."""
    try:
        trace = condition(recording(np.arange(len(x)) / RATE, x, force), options)
    except ConditioningError:
        return False
    return any(one.name == "tare" and one.severity == "warning" for one in trace.findings)


def main() -> None:
    """Print how many of the right logs are turned round, and how many reversed ones put right."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--without", action="store_true", help="no doubt of preloads")
    parser.add_argument("--tares", action="store_true", help="count warnings of a tare instead")
    options = parser.parse_args()
    random, declared = np.random.default_rng(options.seed), load_configuration().conditioning
    right = wrong = 0
    with ExitStack() as doubts:
        if options.without:
            doubts.enter_context(patch.object(polarity, "_OF_HIDDEN", 0.0))
            doubts.enter_context(patch.object(polarity, "held_share", lambda _: 0.0))
            doubts.enter_context(patch.object(polarity, "_OF_PRELOADS", 0.0))
        for _ in range(options.dampers):
            x, force, known = drawn(random, declared)
            x = x + random.normal(0.0, 4e-6, len(x))
            force = force + random.normal(0.0, 3.0, len(x))
            if options.tares:
                gas = known.gas
                right += warns_of_tare(x, force, known)
                tared = force + gas.rod_area * (gas.pressure - ATMOSPHERE)
                wrong += warns_of_tare(x, tared, known)
                continue
            right += is_turned(x, force, known)
            wrong += is_turned(-x, -force, known)
    if options.tares:
        print(f"of {options.dampers} right logs {right} are told to be tared; of as many without "
              f"their gas force {wrong}")  # fmt: skip
        return
    print(f"of {options.dampers} right logs {right} are turned round; of as many reversed ones "
          f"{wrong} are put right")  # fmt: skip


if __name__ == "__main__":
    main()
