"""How well the promise of `advise` is kept: python -m tests.after_fit.advised --seeds 2.

For each seed a campaign of five settings is made and fitted, by procedure paper and joint in turn;
the best test for three questions is made with other noise and fitted together with it. Printed are
the promised and the measured share of the interval at settings 1, 10 and 20, and their quotient.
"""

import argparse
import math
from pathlib import Path
from tempfile import TemporaryDirectory

import damperfit
from damperfit.after_fit.advise import Question, half_interval

QUESTIONS = ("k_e", "r_m1", "force@0.05m/s")
SETTINGS = (1, 10, 20)


def logs(folder: Path) -> list[str]:
    return sorted(map(str, folder.glob("*setting_*.csv")))


def compared(seed: int, question: str, place: Path):
    """Promised and measured shares by setting."""
    procedure = "joint" if seed % 2 else "paper"
    damperfit.samples(place / "old", settings="1,5,10,15,20", seed=seed)
    old = damperfit.identify(logs(place / "old"), procedure=procedure)
    test = old.advise(question, max_speed=0.7).tests[0]
    config = place / "advised.toml"
    config.write_text(f"[rig]\namplitude = {test.amplitude}\nfrequency = {test.frequency}\n")
    damperfit.samples(
        place / "new",
        settings="1,5,10,15,20",
        seed=seed + 1000,
        config=config,
        cycles=test.cycles + 1,
    )
    for path in logs(place / "new"):
        Path(path).rename(Path(path).with_name(f"new_{Path(path).name}"))
    both = damperfit.identify([*logs(place / "old"), *logs(place / "new")], procedure=procedure)
    asked = Question.of(question)
    for setting in SETTINGS:
        now, after = (half_interval(run, run.setting(setting), asked) for run in (old, both))
        yield setting, test.shares[str(setting)], after / now


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2)
    quotients = []
    for seed in range(parser.parse_args().seeds):
        for question in QUESTIONS:
            with TemporaryDirectory() as place:
                for setting, promised, measured in compared(seed, question, Path(place)):
                    quotients.append(measured / promised)
                    print(
                        f"seed {seed} {question:14} setting {setting:2}: promised {promised:.3f}, "
                        f"measured {measured:.3f}, {measured / promised:.2f}",
                        flush=True,
                    )
    off = [math.exp(abs(math.log(quotient))) for quotient in quotients]
    print(f"{sum(o <= 1.5 for o in off)} of {len(off)} within 1.5, worst {max(off):.2f}")


if __name__ == "__main__":
    main()
