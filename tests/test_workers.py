"""Whoever works on many things gives the same results in order, and one module says who."""

from __future__ import annotations

import pickle
import threading

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import MODELS
from damperfit.fleets.run import DamperTask, Done, Job
from damperfit.fleets.sources import FleetLog
from damperfit.workers import InTurn, Threads, executor


@pytest.mark.parametrize(("jobs", "kind"), [(0, InTurn), (1, InTurn), (2, Threads)])
def test_one_job_needs_no_thread(jobs, kind):
    with executor(jobs) as pool:
        assert isinstance(pool, kind)
        (own,) = set(pool.map(lambda _: threading.get_ident(), [1]))
        assert (own == threading.get_ident()) == (kind is InTurn)


@pytest.mark.parametrize("jobs", [1, 3])
class TestInThisProcess:
    def test_results_come_in_the_order_of_the_items(self, jobs):
        is_second_done = threading.Event()

        def wait_for_the_second(number, text):
            if jobs > 1 and number == 0:
                assert is_second_done.wait(30.0)
            is_second_done.set()
            return f"{text}{number}"

        with executor(jobs) as pool:
            assert list(pool.map(wait_for_the_second, [0, 1, 2], "abc")) == ["a0", "b1", "c2"]

    def test_an_error_is_raised_where_its_result_would_stand(self, jobs):
        with executor(jobs) as pool:
            results = pool.map(lambda k: 6 // k, [3, 0, 1])
            assert next(results) == 2
            with pytest.raises(ZeroDivisionError):
                next(results)

    def test_each_hands_an_error_over_as_the_result_of_its_item(self, jobs):
        with executor(jobs) as pool:
            found = dict(pool.each(lambda k: 6 // k, [3, 0, 1]))
        assert isinstance(found.pop(0), ZeroDivisionError)
        assert found == {3: 2, 1: 6}

    def test_each_takes_items_as_workers_become_free(self, jobs):
        taken = []

        def items():
            for k in range(100):
                taken.append(k)
                yield k

        with executor(jobs) as pool:
            found = pool.each(lambda k: k, items())
            next(found)
            assert len(taken) <= 2 * jobs
            found.close()

    def test_nothing_is_begun_once_the_user_wants_to_stop(self, jobs):
        done = []
        with executor(jobs) as pool:
            for item, _ in pool.each(lambda k: k, range(100), cancelled=lambda: len(done) >= 2):
                done.append(item)
        assert len(done) <= 2 * jobs + 1


@pytest.mark.parametrize("model", sorted(MODELS))
def test_what_goes_to_a_worker_can_be_pickled(model, tmp_path):
    document = tmp_path / "damper.toml"
    document.write_text(f'[damper]\nmodel = "{model}"\n')
    configuration = load_configuration(document)
    task = DamperTask(
        "D1", (FleetLog("/logs/a.csv", "a.csv"),), (FleetLog("/logs/tests.csv", "tests.csv"),)
    )
    job = Job(task, configuration, tmp_path, (("/logs/a.csv", "it ended its worker"),))
    back = pickle.loads(pickle.dumps(job))  # noqa: S301 - of this test
    assert (back.task, back.folder, back.dead) == (job.task, job.folder, job.dead)
    assert back.configuration.document == configuration.document
    assert back.configuration.damper == configuration.damper
    done = Done.later(task, "no room")
    assert pickle.loads(pickle.dumps(done)) == done  # noqa: S301
