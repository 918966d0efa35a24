"""Which way a log counts displacement and force: put right where it is certain, else asked.

1. A damper takes energy, so mean(f v) > 0: that fixes the product of both signs.
2. What was declared is taken as it is, and doubted only where the opposite were certain. With one
   sign declared, the energy fixes the other.
3. The gas pushes the rod out: the force level (`gas_force`) is -a_r P_0 in the project's signs,
   and of the other sign when the force is counted positive in bump. That is certain when

   - the level is `_CERTAIN` times what the gas gives, and more than twice its own uncertainty with
     what preloads may hide in it: those of rebound are mostly the larger ones, and lift the level
     above zero, where a gas force that is counted reversed has it;
   - the strokes are not so digressive that no valve of the model could do it;
   - rebound curves more than bump, as valve 1 has it (a_p1^3 against a_r^3).

Where nothing is certain and the loop takes energy, the log is taken as it is, with a warning; where
it gives energy, the log is refused with the question that must be answered.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import ConditioningError
from damperfit.recording import Finding
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from damperfit.conditioning.gas_force import ForceLevel
    from damperfit.recording import Recording, Trace

__all__ = ["TARED", "Signs", "find_signs", "reversed_in"]

# Mean of f v over mean of |f v|: near -1 or 1 for a damper, less where elasticity rules.
_CLEAR_ENERGY = 0.1
# Level over gas force, of right logs near 1: `python -m tests.conditioning.corrections_grid` shows
# it over settings, K_e, gas pressures, strokes and a second damper.
_CERTAIN = (0.5, 1.7)
# Sum of both curvatures, which the same command shows; a damper that yields first and flows then,
# as magneto-rheological ones, has less than the model's valves.
_LEAST_CURVATURE = -0.6
# Times what valves that open early may hide of a level. Of 1500 right logs of made-up valves with
# preloads of 10 to 1000 N one is turned round with it and with what yields, and 18 without; of
# reversed ones 110 are put right after 246 (`python -m tests.conditioning.unlike_preloads`).
_OF_HIDDEN = 2.0
TARED = 0.25  # below this share of the gas force there is none to be seen
_CHANNELS = ("displacement", "force")
_ASK = (
    "declare rig.reverse_displacement and rig.reverse_force: true where the log counts bump (rod "
    "in, compression) positive, else false"
)


@dataclass(frozen=True, slots=True)
class Signs:
    """What must be reversed, and what is to be reported.

    Attributes
    ----------
    reversed_channels : tuple of str
        "displacement", "force", both or none.
    findings : tuple of Finding
        A note for each channel reversed; a warning where the direction is not known.
    """

    reversed_channels: tuple[str, ...]
    findings: tuple[Finding, ...] = ()


def find_signs(trace: Trace, recording: Recording, level: ForceLevel | None) -> Signs:
    """Return which channels of a log must be reversed.

    Parameters
    ----------
    trace : Trace
        Of the recording as it stands.
    recording : Recording
        Tells which signs were declared.
    level : ForceLevel or None
        Of the trace; None where nothing is known of the gas.

    Raises
    ------
    ConditioningError
        The loop gives energy, and both signs were declared or it is not certain which is wrong.
    """
    share, joules = _energy(trace)
    free = [name for name in _CHANNELS if getattr(recording, f"reverse_{name}") is None]
    if abs(share) < _CLEAR_ENERGY:
        return Signs((), (_no_energy(share),))
    if share > 0.0:
        return _both_or_none(level, free)
    gives = f"the loop gives {-joules:.3g} J a cycle as logged"
    if len(free) == 1:
        return _reversed(free, f"{gives}, and the sign of the other channel is declared")
    if not free:
        raise _question(trace, joules, "both signs are declared, and one of them wrongly")
    return _one(trace, level, joules, gives)


def reversed_in(recording: Recording, trace: Trace) -> list[str]:
    """Return the channels of a log that count bump positive, as declared or as found.

    Parameters
    ----------
    recording : Recording
        As it was read.
    trace : Trace
        What was made of it.
    """
    found = {one.name for one in trace.findings if one.is_correction}
    return [
        channel
        for channel in _CHANNELS
        if getattr(recording, f"reverse_{channel}") or f"{channel}_polarity" in found
    ]


def _energy(trace: Trace) -> tuple[float, float]:
    """Return mean(f v) over mean(|f v|), and J per cycle."""
    power = trace.force[trace.compared] * trace.velocity[trace.compared]
    mean = mean_of(power)
    return mean / max(mean_of(np.abs(power)), 1e-300), mean / trace.frequency


def _both_or_none(level: ForceLevel | None, free: list[str]) -> Signs:
    """Return the signs of a log that takes energy: as it is, or both reversed."""
    if level is None or level.ratio > TARED:
        return Signs(())
    if len(free) < len(_CHANNELS):
        # A cell zeroed before mounting shows any level; a declaration is doubted for more.
        is_doubted = _is_certain(level, _CHANNELS)
        kept = "the declared signs are kept; check them again"
        return _doubt(level, kept) if is_doubted else Signs(())
    if _is_certain(level, _CHANNELS):
        return _reversed(_CHANNELS, f"{_level_in_words(level)}, and the loop absorbs energy")
    return _doubt(level, f"taken as logged; {_ASK}")


def _one(trace: Trace, level: ForceLevel | None, joules: float, gives: str) -> Signs:
    """Return the one channel that is reversed in a log that gives energy."""
    if level is None:
        raise _question(trace, joules, "")
    for channel in _CHANNELS:
        if _is_certain(level, (channel,)):
            return _reversed((channel,), f"{gives}, and {_level_in_words(level)}")
    raise _question(trace, joules, f"{_level_in_words(level)}: that does not show which of the two")


def _seen(level: ForceLevel, reversed_channels: tuple[str, ...]) -> ForceLevel:
    """Return the level as it would be with channels reversed."""
    rebound, bump = level.rebound_curvature, level.bump_curvature
    if "displacement" in reversed_channels:
        rebound, bump = -bump, -rebound
    if "force" not in reversed_channels:
        return replace(level, rebound_curvature=rebound, bump_curvature=bump)
    return replace(
        level,
        branches=-level.branches,
        reversals=-level.reversals,
        rebound_curvature=-rebound,
        bump_curvature=-bump,
    )


def _is_certain(level: ForceLevel, reversed_channels: tuple[str, ...]) -> bool:
    """Whether the log is a gas damper's with these channels reversed, beyond doubt."""
    seen = _seen(level, reversed_channels)
    # Of one reversed channel alone the strokes are not as they seem, nor is what they hide.
    hidden = _OF_HIDDEN * seen.hidden if len(reversed_channels) == len(_CHANNELS) else 0.0
    return (
        _CERTAIN[0] < seen.ratio < _CERTAIN[1]
        and abs(seen.force) > 2.0 * (seen.uncertainty + seen.held + hidden)
        and seen.rebound_curvature + seen.bump_curvature > _LEAST_CURVATURE
        and seen.rebound_curvature > seen.bump_curvature
    )


def _level_in_words(level: ForceLevel) -> str:
    """Return the level beside the gas force, for people."""
    return (
        f"at zero velocity the force is {level.force:.0f} +- {level.uncertainty + level.held:.0f} "
        f"N; the gas force alone is {level.expected:.0f} N"
    )


def _reversed(channels: tuple[str, ...] | list[str], reason: str) -> Signs:
    findings = tuple(
        Finding(
            f"{channel}_polarity",
            "note",
            f"{channel}: found positive in bump and reversed: {reason}; "
            f"rig.reverse_{channel} = true confirms this, false keeps it as logged",
            -1.0,
            is_correction=True,
        )
        for channel in channels
    )
    return Signs(tuple(channels), findings)


def _doubt(level: ForceLevel, advice: str) -> Signs:
    sees = "so no gas force distinguishes rebound from bump"
    if level.ratio <= -TARED and abs(level.force) > level.uncertainty + level.held:
        sees = "as if both channels were positive in bump, but that is not certain"
    return Signs(
        (),
        (
            Finding(
                "direction", "warning", f"{_level_in_words(level)}, {sees}; {advice}", level.ratio
            ),
        ),
    )


def _no_energy(share: float) -> Finding:
    text = (
        f"the loop absorbs hardly any energy ({100.0 * share:.0f} % of its throughput): the signs "
        "of the channels cannot be determined, and this can hardly be a damper; check columns and "
        "skew"
    )
    return Finding("force_polarity", "warning", text, share)


def _question(trace: Trace, joules: float, doubt: str) -> ConditioningError:
    return ConditioningError(
        f"{trace.name}: the damper delivers {-joules:.3g} J per cycle instead of absorbing energy: "
        f"force or displacement is reversed{f'; {doubt}' if doubt else ''}; {_ASK}"
    )
