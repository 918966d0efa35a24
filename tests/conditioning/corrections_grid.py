"""How well signs and tare are told, over settings, oils, strokes and dampers.

    python -m tests.conditioning.corrections_grid

Prints one line a case: the force level against the gas force, and how each convention is taken.
"""

from dataclasses import replace

from damperfit.conditioning import ConditionOptions, condition
from damperfit.conditioning.polarity import force_level
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.errors import ConditioningError
from tests.conditioning.test_signs import MIRRORS, SLIM, SLIM_SETTING, gas_of, mirrored
from tests.identification.rig import recording


def level_cases():
    """Yield name, damper, parameters, amplitude, duration."""
    for n in range(1, 21):
        yield f"setting {n}", PURDY_DAMPER, reference_parameters(n), 0.032, 8.0
    for k_e in (1e8, 3e8, 1e9, 2e9):
        for n in (1, 10, 15, 19, 20):
            parameters = replace(reference_parameters(n), k_e=k_e)
            yield f"K_e {k_e:.0e}, setting {n}", PURDY_DAMPER, parameters, 0.032, 8.0
    for bar in (2.0, 10.0, 20.0):
        damper = replace(PURDY_DAMPER, gas_pressure=1e5 * bar)
        for n in (1, 10, 20):
            yield f"{bar:g} bar, setting {n}", damper, reference_parameters(n), 0.032, 8.0
    for amplitude in (0.003, 0.005, 0.01, 0.05):
        for n in (1, 10, 20):
            name = f"{1e3 * amplitude:g} mm, setting {n}"
            yield name, PURDY_DAMPER, reference_parameters(n), amplitude, 8.0
    for factor in (0.2, 1.0):
        parameters = replace(SLIM_SETTING, k_e=factor * SLIM_SETTING.k_e)
        yield f"slim, K_e times {factor}", SLIM, parameters, 0.02, 8.0


def show_level(name, damper, parameters, amplitude, duration) -> None:
    """Print the level of a case and how the four sign conventions are taken."""
    gas = gas_of(damper)
    log = recording(
        1, parameters, damper=damper, noise=4.0, rate=500.0, duration=duration, amplitude=amplitude
    )
    level = force_level(condition(log), gas)
    taken = []
    for mirror, signs in MIRRORS.items():
        try:
            trace = condition(mirrored(log, signs), ConditionOptions(gas=gas))
        except ConditioningError:
            taken.append("asked")
            continue
        changed = [
            one.code.split("_")[0] for one in trace.findings if one.values.get("is_correction")
        ]
        expected = [c for c, s in zip(("displacement", "force"), signs, strict=True) if s < 0.0]
        is_doubted = any(one.code == "direction" for one in trace.findings)
        is_right = changed == expected
        taken.append("right" if is_right else "doubted" if is_doubted else f"WRONG ({mirror})")
    print(
        f"{name:28s} gas {level.expected:7.1f} N  level {level.force:7.1f} +- "
        f"{level.uncertainty:5.1f} N  ratio {level.ratio:5.2f}  "
        f"curvatures {level.rebound_curvature + level.bump_curvature:5.2f}  {' '.join(taken)}"
    )


if __name__ == "__main__":
    for case in level_cases():
        show_level(*case)
