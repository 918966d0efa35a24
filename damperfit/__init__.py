"""damperfit reads damper rig logs and fits a physical damper model at every adjuster setting.

    import damperfit
    run = damperfit.identify("sample_runs/*.csv")
    run.setting(10).simulate("sine", amplitude=0.04, frequency=2.0).force

The functions of `damperfit.api`, one a command, `Damper`, `Motion` and `Run` are looked up when
they are first used: importing damperfit imports nothing else, so that ``damperfit --help`` starts
at once. The layers below are importable by their own names.
"""

TYPE_CHECKING = False  # nothing may be imported before `own_process.begin`, not even __future__
if TYPE_CHECKING:
    from typing import Any

__all__ = ["__version__"]

__version__ = "0.1.0"

# A name of the door, and the module that has it.
_DOOR = {
    "Damper": "damperfit.damper.purdy.parameters",
    "Motion": "damperfit.simulation",
    "Run": "damperfit.results",
    **dict.fromkeys(
        ("advise", "passport", "ride", "valves", "watch"), "damperfit.after_fit.functions"
    ),
    **dict.fromkeys(
        (
            "compare",
            "export",
            "fleet",
            "identify",
            "init",
            "inspect",
            "load",
            "models",
            "read",
            "report",
            "samples",
            "settings",
            "simulate",
            "sweep",
        ),
        "damperfit.api",
    ),
}


def __getattr__(name: str) -> "Any":
    """Look a name of the door up."""
    if name not in _DOOR:
        from damperfit.errors import did_you_mean

        raise AttributeError(f"damperfit has no {name!r}.{did_you_mean(name, _DOOR)}")
    from importlib import import_module

    return getattr(import_module(_DOOR[name]), name)


def __dir__() -> list[str]:
    """Return the names of the door."""
    return sorted([*__all__, *_DOOR])
