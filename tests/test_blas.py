"""BLAS has its threads back when the last of several runs in one process has ended."""

import subprocess
import sys
import threading
from contextlib import ExitStack

import pytest
import scipy.linalg  # noqa: F401 - it brings a BLAS of its own
from threadpoolctl import threadpool_info, threadpool_limits

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import FitOptions, blas_threads, identify
from damperfit.identification.blas_threads import one_blas_thread
from tests.fakes import trace


def threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def three_threads(monkeypatch):
    """A number that is neither one nor, by chance, the machine's; libraries are looked for anew."""
    monkeypatch.setattr(blas_threads, "_found", {})
    with threadpool_limits(3, user_api="blas"):
        assert threads() == {3}
        yield


def test_the_first_to_end_leaves_it_lowered_and_the_last_puts_it_back() -> None:
    first, second = ExitStack(), ExitStack()
    first.enter_context(one_blas_thread())
    assert threads() == {1}
    second.enter_context(one_blas_thread())
    first.close()
    assert threads() == {1}
    second.close()
    assert threads() == {3}


def test_libraries_are_looked_for_again_once_a_module_more_is_there(monkeypatch) -> None:
    def libraries():
        with one_blas_thread():
            assert threads() == {1}
        assert threads() == {3}
        (found,) = blas_threads._found.values()
        return found

    known = libraries()
    assert known
    assert libraries() is known
    monkeypatch.setitem(sys.modules, "one_that_may_bring_a_library", sys)
    assert libraries() is not known


def test_an_error_puts_it_back_too() -> None:
    with pytest.raises(ZeroDivisionError), one_blas_thread(), one_blas_thread():
        _ = 1 / 0
    assert threads() == {3}


def test_two_runs_that_overlap_in_threads_leave_it_as_it_was() -> None:
    """The first begins, the second begins, the first ends, the second ends."""
    options = FitOptions(procedure="plain", fixed={"r_m3": 2.6e6, "f_f": 50.0})
    both_are_in = threading.Barrier(2, timeout=60.0)
    first_is_done = threading.Event()
    during: dict[str, set[int]] = {}
    met: set[str] = set()

    def run(name: str) -> None:
        def on_fit(_fit: object) -> None:
            if name in met:
                return
            met.add(name)
            both_are_in.wait()
            if name == "second":
                first_is_done.wait(60.0)
            during[name] = threads()

        identify([trace(1)], PURDY_DAMPER, options, on_fit=on_fit)
        if name == "first":
            first_is_done.set()

    both = [threading.Thread(target=run, args=(name,)) for name in ("first", "second")]
    for one in both:
        one.start()
    for one in both:
        one.join(120.0)
    assert during == {"first": {1}, "second": {1}}
    assert threads() == {3}


def test_a_library_that_is_loaded_meanwhile_is_lowered_and_put_back() -> None:
    code = (
        "from threadpoolctl import threadpool_info\n"
        "from damperfit.identification.blas_threads import one_blas_thread\n"
        "def seen(): return [i['num_threads'] for i in threadpool_info() "
        "if i['user_api'] == 'blas']\n"
        "with one_blas_thread():\n"
        "    import scipy.linalg\n"
        "    with one_blas_thread():\n"
        "        assert set(seen()) == {1}, seen()\n"
        "assert set(seen()) == {2}, seen()\n"
        "assert len(seen()) >= 1\n"
    )
    environment = {"OPENBLAS_NUM_THREADS": "2", "PATH": ""}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
