"""How well the promise of `advise` is kept: python -m tests.after_fit.advised --dampers 10.

Of each damper, whose numbers are drawn within a third about the reference set, a campaign of five
settings is made and fitted, by procedure paper and joint in turn, on request behind a filter of the
rig. The best test for three questions is made with other noise and fitted together with the
campaign. Printed are the promised and the measured share of the interval, as the median of the
settings, and their quotient; then how many quotients are within 1.5, of all tests, of those that
are said to help, and of single settings.
"""

import argparse
import math
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

import damperfit
from damperfit.adjustment.force_at import force_at
from damperfit.damper.purdy.parameters import reference_parameters

QUESTIONS = ("k_e", "r_m1", "force@0.05m/s")
SETTINGS = (1, 5, 10, 15, 20)
DRAWN = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
WITHIN, USEFUL = 1.5, 0.8  # a larger share: no test narrows it, says the answer


def truth(damper: int, path: Path) -> Path:
    factors = np.exp(np.random.default_rng(damper).normal(0.0, 0.3, len(DRAWN)))
    lines = ["setting," + ",".join((*DRAWN, "f_0"))]
    for setting in SETTINGS:
        values = reference_parameters(setting)
        known = [values[name] * factor for name, factor in zip(DRAWN, factors, strict=True)]
        lines.append(",".join(map(str, (setting, *known, 0.0))))
    path.write_text("\n".join(lines) + "\n")
    return path


def half_interval(run, setting: int, question: str) -> float:
    """As it is shown, to a common factor."""
    one = run.setting(setting)
    if question.startswith("force@"):
        speed = float(question.removeprefix("force@").removesuffix("m/s"))
        return force_at([one], run.damper, [speed], measured=run.speed_forces)[0].reach
    error, misfit = (one.row[f"{question}{end}"] for end in ("_se", "_misfit_se"))
    return math.hypot(error, misfit or 0.0) / one.values[question]


def compared(damper: int, corner: float, place: Path):
    """Promised and measured shares by question and setting."""
    rig = f'filter = "analogue"\nfilter_corner = {corner}\n' if corner else ""
    table = truth(damper, place / "truth.csv")

    def made(name: str, motion: str, seed: int, cycles: float) -> list[str]:
        config = place / f"{name}.toml"
        config.write_text(f"[rig]\n{motion}")
        damperfit.samples(
            place / name,
            settings=SETTINGS,
            parameters=table,
            seed=seed,
            cycles=cycles,
            config=config,
            rig_filter=corner,
        )
        paths = sorted((place / name).glob("setting_*.csv"))
        return [str(path.rename(path.with_name(f"{name}_{path.name}"))) for path in paths]

    def fitted(logs: list[str]):
        config = place / "rig.toml"
        config.write_text(f"[rig]\n{rig}")
        return damperfit.identify(logs, procedure="joint" if damper % 2 else "paper", config=config)

    logs = made("old", "", damper, 15.0)
    old = fitted(logs)
    for question in QUESTIONS:
        test = old.advise(question, max_speed=0.7).tests[0]
        motion = f"amplitude = {test.amplitude}\nfrequency = {test.frequency}\n"
        name = f"new_{QUESTIONS.index(question)}"
        both = fitted([*logs, *made(name, motion, damper + 1000, test.cycles + 2)])
        yield (
            question,
            test,
            {
                setting: (
                    test.shares[str(setting)],
                    half_interval(both, setting, question) / half_interval(old, setting, question),
                )
                for setting in SETTINGS
            },
        )


def off(promised: float, measured: float) -> float:
    return math.exp(abs(math.log(measured / promised)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dampers", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--rig-filter", type=float, default=0.0)
    given = parser.parse_args()
    whole, helpful, single = [], [], []
    for damper in range(given.first, given.first + given.dampers):
        with TemporaryDirectory() as place:
            for question, test, shares in compared(damper, given.rig_filter, Path(place)):
                promised, measured = (
                    median(column) for column in zip(*shares.values(), strict=True)
                )
                whole.append(off(promised, measured))
                helpful += whole[-1:] if promised <= USEFUL else []
                single += [off(*pair) for pair in shares.values()]
                each = " ".join(f"{b / a:.2f}" for a, b in shares.values())
                print(
                    f"damper {damper} {question:14} {1e3 * test.amplitude:.3g} mm at "
                    f"{test.frequency:.3g} Hz: promised {promised:.3f}, measured {measured:.3f}, "
                    f"{measured / promised:.2f}; by setting {each}",
                    flush=True,
                )
    for what, quotients in (("tests", whole), ("that help", helpful), ("settings", single)):
        kept = sum(one <= WITHIN for one in quotients)
        print(f"{kept} of {len(quotients)} {what} within {WITHIN}, worst {max(quotients):.2f}")


if __name__ == "__main__":
    main()
