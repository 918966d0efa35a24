"""How near fits come to dampers whose logs an integrator made that is not the core's.

    python -m tests.rig_like.accuracy --dampers 5
    python -m tests.rig_like.accuracy --dampers 5 --play

Dampers of each topology as in `tests.identification.convergence`, in the library's laws: three
speeds, 4 N and 8 um of noise at 1 kHz. Beside them the rod has 50 g and friction bends 2 um, which
no law knows. Errors are told of what is told; the others are counted.
"""

import argparse
from dataclasses import dataclass, field

import numpy as np

from damperfit.conditioning import condition
from damperfit.identification import FitOptions, compare, identify
from damperfit.recording import Trace
from damperfit.uncertainty import assess
from tests.identification.convergence import AMPLITUDE, KINDS, SOLVER, SPEEDS, made_up
from tests.identification.rig import recorded
from tests.rig_like.rig import Body, Channels, Valve, logged, steps

BARS = {"force": 0.5, "opening": 3.0, "bleed": 2.0, "k_s": 5.0, "play": 10.0}  # per cent
_TOLD = {"fitted", "shared"}


@dataclass(frozen=True)
class Accuracy:
    """Errors of one damper in per cent by name, what its intervals hold, what is not told."""

    errors: dict[str, float]
    covered: dict[str, bool]
    undetermined: tuple[str, ...] = ()
    said: tuple[str, ...] = field(default=())

    def of(self, part: str) -> list[float]:
        """Errors of one kind."""
        return [error for name, error in self.errors.items() if name.endswith(part)]


def body_of(model, truth) -> Body:
    """The same damper for the rig."""

    def valve(stroke: str) -> Valve:
        numbers = {
            part: getattr(truth, f"{stroke}_{part}") for part in ("bleed", "opening", "slope")
        }
        return Valve(**numbers)

    return Body(
        model.name, valve("rebound"), valve("compression"),
        check=Valve(slope=getattr(truth, "return_slope", 1e5)),
        rod=model.rod_diameter, piston=model.piston_diameter, length=model.chamber_1_length,
        density=model.oil_density, gas_pressure=model.gas_pressure, gas_volume=model.gas_volume,
        gas_exponent=model.gas_exponent, bulk=truth.k_e, stiffness=truth.k_s,
        play=getattr(truth, "play", 0.0), friction=truth.f_f,
    )  # fmt: skip


def traces_of(model, truth, seed: int) -> tuple[Trace, Trace]:
    """The log as conditioned, and the same without noise."""
    motion = steps(SPEEDS, AMPLITUDE, 4.0)
    body = body_of(model, truth)
    found = []
    for channels in (Channels(offset=truth.f_0), Channels(offset=truth.f_0, noise=0.0, jitter=0.0)):
        log = logged(body, motion, channels, seed)
        found.append(condition(recorded(log.displacement, log.force, channels.rate, setting=1)))
    return found[0], found[1]


def measured(kind: str, seed: int, *, has_play: bool = False) -> Accuracy:
    """Fit one damper and compare it with the truth."""
    model, truth = made_up(kind, seed, has_play=has_play)
    trace, clean = traces_of(model, truth, seed)
    campaign = identify([trace], model, FitOptions("plain", solver=SOLVER))
    fit, (known,) = campaign.fits[0], assess(campaign, model).uncertainties
    errors, covered, undetermined = {}, {}, []
    for name in model.names:
        part = next((one for one in BARS if name.endswith(one)), "")
        if not part:
            continue
        true, value = getattr(truth, name), getattr(fit.parameters, name)
        if fit.status[name].value not in _TOLD:
            undetermined.append(name)
            continue
        errors[name] = 100.0 * abs(value / true - 1.0)
        interval = known.intervals[name]
        covered[name] = interval.low <= true <= interval.high
    force = compare(fit.parameters, clean, model).force
    level = truth.f_0 + float(
        model.rest_force(0.0)
    )  # the gas's, beside which damping may be little
    for k, segment in enumerate(clean.segments):
        part_of, true_part = force[segment.window], clean.force[segment.window]
        for stroke, peak in (("rebound", np.max), ("bump", np.min)):
            error = abs(peak(part_of) - peak(true_part))
            damping = abs(peak(true_part) - level)
            errors[f"{stroke}_{k}_force"] = float(100.0 * error / damping)
    return Accuracy(errors, covered, tuple(undetermined), tuple(map(str, campaign.warnings)))


def main() -> None:
    """Print a line for each topology and kind of number."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=5, help="of each topology")
    parser.add_argument("--play", action="store_true", help="joints with play")
    given = parser.parse_args()
    for kind in KINDS:
        found = [measured(kind, seed, has_play=given.play) for seed in range(given.dampers)]
        held = [one for accuracy in found for one in accuracy.covered.values()]
        lost = sum(len(one.undetermined) for one in found)
        said = f"{sum(held)} of {len(held)} in their intervals, {lost} not told"
        print(f"{kind}: {said}", flush=True)
        for part, bar in BARS.items():
            errors = [error for one in found for error in one.of(part)]
            if errors:
                within = sum(error <= bar for error in errors)
                worst, middle = max(errors), float(np.median(errors))
                said = f"{within} of {len(errors)} within {bar:g} %"
                print(f"  {part}: {said}, worst {worst:.2f} %, median {middle:.2f} %", flush=True)


if __name__ == "__main__":
    main()
