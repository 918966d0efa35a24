"""Work that ends its worker: of a module, as a new process must find it."""

import os
import signal
import threading
import time
from pathlib import Path

from damperfit.workers import Processes


def double(number: int) -> int:
    return 2 * number


def refuse_with_a_lock(number: int) -> None:
    """Raise what no pipe takes."""
    error = ValueError(f"no {number}")
    error.held = threading.Lock()  # type: ignore[attr-defined]
    raise error


def die_at_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def refuse(number: int) -> int:
    raise ValueError(f"no {number}")


def say_pid_and_wait(path: str) -> int:
    Path(path).write_text(str(os.getpid()))
    time.sleep(600.0)
    return 0


def is_gone(pid: int, seconds: float = 20.0) -> bool:
    """Wait for the end of a process."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        stat = Path(f"/proc/{pid}/stat")
        if stat.exists() and stat.read_text().split()[2] == "Z":  # ended, and nobody waits for it
            return True
        time.sleep(0.02)
    return False


def die_of_poison(pair):
    """Do the work, unless a log that is not left out is called poison."""
    act, task = pair
    dead = dict(task.dead)
    if any("poison" in log.file and log.place not in dead for log in task.logs):
        os.kill(os.getpid(), signal.SIGKILL)
    return act(task)


class Poisoned:
    """Processes that a log called poison ends."""

    def __init__(self, number: int) -> None:
        self.processes = Processes(number)
        self.n_begun = 0

    def each(self, act, items, *, cancelled=lambda: False):
        def counted():
            for item in items:
                self.n_begun += 1
                yield act, item

        found = self.processes.each(die_of_poison, counted(), cancelled=cancelled)
        return ((pair[1], result) for pair, result in found)
