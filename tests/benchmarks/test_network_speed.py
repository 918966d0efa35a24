"""The paper's model by the step of its kind, and by the general one: with a blow-off that is shut.

pytest tests/benchmarks/test_network_speed.py -m extras -n 0
"""

import pytest

from damperfit.damper.network import purdy, purdy_blow_off, simulate_network
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.simulation import SolverOptions, sine_motion

VALUES = {"r_m1": 1.8e4, "r_m2": 3.527e6, "r_m3": 2.597e6, "k_e": 3.65e8, "f_f": 50.0}
SHUT = {"rebound_opening": 1e9, "rebound_slope": 1e7, "compression_opening": 0.0}
NAMES = ("r_m1", "r_m2", "k_e")
OPTIONS = SolverOptions(tolerance=1e-2, rounding=1.0)
MOTION = sine_motion(0.032, 1.5, cycles=15, sample_rate=1000)


def of_its_kind():
    return simulate_network(
        purdy(), VALUES, PURDY_DAMPER, MOTION, sensitivities=NAMES, options=OPTIONS
    )


def in_general():
    return simulate_network(
        purdy_blow_off(), VALUES | SHUT, PURDY_DAMPER, MOTION, sensitivities=NAMES, options=OPTIONS
    )


@pytest.mark.benchmark(group="10 s at 1 kHz with three sensitivities")
@pytest.mark.parametrize("run", [of_its_kind, in_general])
def test_one_simulation(benchmark, run):
    response = benchmark(run)
    assert response.force.max() == pytest.approx(of_its_kind().force.max(), abs=0.05)


def test_both_take_the_same_steps():
    assert in_general().work == of_its_kind().work
