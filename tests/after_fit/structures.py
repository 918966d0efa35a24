"""Whether the test that `advise --for law` names decides: python -m tests.after_fit.structures.

Dampers of valves are drawn by chance (`tests.laws.rates`) and logged at one low speed, which leaves
structures open. The advised test is made of the true damper and fitted together with that log. It
has decided where, of the structure that was chosen and those that it was to be told from, no two
are chosen or remain; none does where the truth was not among them. Where there is nothing to
decide, or no test that does, that is printed. Two minutes of the processor a damper.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import damperfit
from damperfit.after_fit.advise import remaining
from damperfit.configuration.damper_section import damper_record
from tests.laws.rates import draw
from tests.laws.valve_logs import log_text, moved

SLOW, RATE = 0.06, 500.0
GEOMETRY = (
    "rod_diameter", "piston_diameter", "chamber_1_length", "chamber_2_length", "oil_density",
    "gas_pressure", "gas_volume", "gas_exponent",
)  # fmt: skip


def structures(run) -> set[str]:
    """What was chosen and what remains, as it is declared."""
    return {str(damper_record(one)) for one in (run.damper, *(x.damper for x in remaining(run)))}


def decided(place: int, seed: int, folder: Path) -> tuple[str, bool | None]:
    """Return what was found in words, and whether the test decided; None: there was none."""
    drawn = draw(place, seed)
    owner = {name: getattr(drawn.model, name) for name in GEOMETRY}

    def fitted(**motions) -> damperfit.Run:
        for name, motion in motions.items():
            text = log_text(drawn.model, drawn.values, motion, setting=1, seed=seed)
            (folder / f"{name}_s1.csv").write_text(text, encoding="utf-8")
        logs = sorted(map(str, folder.glob("*_s1.csv")))
        config = folder / "damper.toml"
        lines = (f"{name} = {value!r}" for name, value in owner.items())
        config.write_text("[damper]\n" + "\n".join(lines) + "\n", encoding="utf-8")
        return damperfit.identify(logs, model="auto", config=config)

    first = fitted(slow=moved((SLOW,), rate=RATE, cycles=6))
    advice = first.advise("law", max_stroke=0.03, max_speed=0.5)
    if not advice.tests or not advice.tests[0].decided:
        return advice.sentence, None
    test = advice.tests[0]
    asked = {str(damper_record(first.damper))}
    asked |= {str(damper_record(x.damper)) for x in remaining(first) if x.title in test.decided}
    speeds = (test.speed,)
    motion = moved(speeds, amplitude=test.amplitude, rate=RATE, cycles=test.cycles)
    left = asked & structures(fitted(advised=motion))
    return f"{advice.sentence}: {len(left)} of {len(asked)} left", len(left) < 2


def main() -> None:
    """Print a line a damper, and how many tests decided."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    verdicts = []
    for place in range(given.first, given.first + given.dampers):
        with TemporaryDirectory() as folder:
            words, verdict = decided(place, given.seed, Path(folder))
        print(f"damper {place}: {words}", flush=True)
        verdicts += [] if verdict is None else [verdict]
    print(f"{sum(verdicts)} of {len(verdicts)} decided")


if __name__ == "__main__":
    main()
