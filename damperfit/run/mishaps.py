"""What damperfit itself got wrong in a run, kept with the log or the setting that met it.

A bug that one log meets must not cost the others their results. So the steps of a run are told what
to do without: they leave the log or the setting out, and it becomes a failure.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from damperfit.errors import ConfigurationError, InstallationError, OutputError, mishap_of
from damperfit.run.logs import failure_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.errors import OnError
    from damperfit.problem import Failure
    from damperfit.recording import Trace
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting

__all__ = ["Mishaps"]

_Result = TypeVar("_Result")


@dataclass(slots=True)
class Mishaps:
    """What went wrong so far, from any thread.

    Attributes
    ----------
    batch : LogBatch
        The logs of the run.
    """

    batch: LogBatch
    _found: list[Failure] = field(default_factory=list)

    @property
    def failures(self) -> tuple[Failure, ...]:
        """By setting, those of the whole run last."""
        return tuple(
            sorted(
                self._found, key=lambda one: (one.setting is None, one.setting or 0, one.message)
            )
        )

    def at_setting(self, task: str) -> OnError:
        """Return what takes a setting and the error that a task, as in "judging", has met there."""

        def take(setting: Setting, error: Exception) -> None:
            mishap = mishap_of(error, f"{task} setting {setting}")
            self._found.append(failure_of(mishap, setting=setting))

        return take

    def at_log(self, task: str) -> Callable[[Trace, Exception], None]:
        """Return what takes a log and the error that a task, as in "predicting", has met."""

        def take(trace: Trace, error: Exception) -> None:
            path = next((log.path for log in self.batch.logs if log.log == trace.name), "")
            mishap = mishap_of(error, f"{task} {trace.name}")
            self._found.append(failure_of(mishap, trace.name, path, trace.setting))

        return take

    def add(self, mishap: Failure, setting: Setting | None = None) -> None:
        """Take what a step over all settings, or one of them, has met, and went on."""
        self._found.append(failure_of(mishap, setting=setting))

    def spared(self, task: str, step: Callable[[], _Result], instead: _Result) -> _Result:
        """Return what a step finds, or what the run goes on with where the step has an error.

        Raises
        ------
        ConfigurationError, InstallationError, OutputError
            What is wrong with the command as a whole, and no mishap.
        """
        try:
            return step()
        except (ConfigurationError, InstallationError, OutputError):
            raise
        except Exception as error:  # noqa: BLE001 - what the run has done so far is written
            self._found.append(failure_of(mishap_of(error, task)))
            return instead
