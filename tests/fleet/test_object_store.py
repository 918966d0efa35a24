"""Logs in an object store: found, fetched once, and asked for again where a network refuses."""

import logging
import threading
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.fleets import sources
from damperfit.fleets.parts import collect
from damperfit.fleets.run import State, planned, run_fleet
from damperfit.fleets.sources import find_sources
from tests.fleet.conftest import Here

CONFIGURATION = load_configuration(None)
BUCKET = "bench"
pytestmark = pytest.mark.extras


@dataclass
class Watched:
    """A store that counts what is asked of it."""

    app: object
    asked: Counter = field(default_factory=Counter)
    guard: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, environ, start):
        method, path = environ["REQUEST_METHOD"], environ["PATH_INFO"]
        with self.guard:
            self.asked[method, path.rsplit("/", 1)[-1]] += 1
        return self.app(environ, start)

    def n(self, method: str, suffix: str = ".csv") -> int:
        """Return how many requests of one kind there were for files of one suffix."""
        return sum(
            k for (one, name), k in self.asked.items() if (one, name[-4:]) == (method, suffix)
        )


class Store(NamedTuple):
    """A store on this machine: what puts an object, what makes an address, and who watches."""

    put: object
    address: object
    watched: Watched


@pytest.fixture(scope="module")
def store():
    """A store on this machine."""
    werkzeug_app = pytest.importorskip("moto.moto_server.werkzeug_app")
    serving = pytest.importorskip("werkzeug.serving")
    boto3 = pytest.importorskip("boto3")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "testing")
        patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        app = werkzeug_app.DomainDispatcherApplication(werkzeug_app.create_backend_app)
        watched = Watched(app)
        running = serving.make_server("127.0.0.1", 0, watched, threaded=True)
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        where = f"127.0.0.1:{running.port}"
        client = boto3.client("s3", endpoint_url=f"http://{where}")
        client.create_bucket(Bucket=BUCKET)
        query = f"?scheme=http&endpoint_override={where}&region=us-east-1"

        def put(key: str, text: str) -> None:
            client.put_object(Bucket=BUCKET, Key=key, Body=text.encode())

        yield Store(put, lambda path: f"s3://{BUCKET}/{path}{query}", watched)
        running.shutdown()
        thread.join()


def fleet(wanted: list[str], folder: Path) -> list:
    """Return what became of each damper."""
    return list(run_fleet(CONFIGURATION, planned(CONFIGURATION, wanted, folder), folder, Here()))


def states(done: list) -> dict[str, str]:
    return {one.owner: one.state.value for one in done}


@pytest.fixture(scope="module")
def runs(store, texts):
    """The address of the logs of two dampers, and texts beside them that are none."""
    for serial in ("D1", "D2"):
        for name, (head, rows) in texts.items():
            store.put(f"runs/{serial}/{name}", head + rows)
    store.put("runs/README.md", "no log")
    return store.address("runs")


def test_a_folder_a_pattern_and_a_log_of_a_store_are_found_like_those_of_the_disk(runs, store):
    found = find_sources([runs])
    assert [one.name for one in found] == [
        f"{serial}/setting_{k}.csv" for serial in ("D1", "D2") for k in ("01", "10")
    ]
    assert all(one.is_remote for one in found)
    for wanted, k in (("D2/setting_1*.csv", "10"), ("D1/setting_01.csv", "01")):
        (one,) = find_sources([store.address(f"runs/{wanted}")])
        assert one.file == f"setting_{k}.csv"


def test_logs_of_a_store_give_what_the_same_logs_give_from_the_disk(runs, three, tmp_path):
    remote, local = tmp_path / "remote", tmp_path / "local"
    assert states(fleet([runs], remote)) == {"D1": "fitted", "D2": "fitted"}
    tasks = planned(CONFIGURATION, [str(three)], local)
    list(run_fleet(CONFIGURATION, tasks[:2], local, Here()))
    assert collect(remote).equals(collect(local))


class TestASecondRun:
    """What has not changed is not fetched again; what has changed is done again, always."""

    @pytest.fixture
    def done(self, store, texts, tmp_path):
        """A fleet of two dampers that say in their preamble whose they are."""
        for serial in ("SN1", "SN2"):
            for name, (head, rows) in texts.items():
                store.put(
                    f"{tmp_path.name}/{serial[-1]}/{name}", f"# serial: {serial}\n{head}{rows}"
                )
        wanted = [store.address(tmp_path.name)]
        assert states(fleet(wanted, tmp_path)) == {"SN1": "fitted", "SN2": "fitted"}
        store.watched.asked.clear()
        return wanted

    def test_fetches_the_damper_with_a_changed_log_alone(self, store, done, texts, tmp_path):
        assert states(fleet(done, tmp_path)) == {"SN1": "known", "SN2": "known"}
        assert (store.watched.n("GET"), store.watched.n("HEAD")) == (0, 4)
        head, rows = texts["setting_10.csv"]
        changed = rows.replace("1", "2", 1)  # as long as before, and within the same second
        store.put(f"{tmp_path.name}/2/setting_10.csv", f"# serial: SN2\n{head}{changed}")
        assert states(fleet(done, tmp_path)) == {"SN1": "known", "SN2": "fitted"}
        # Its beginning, which says whose it is, and the two logs of its damper.
        assert store.watched.n("GET") == 3
        assert states(fleet(done, tmp_path)) == {"SN1": "known", "SN2": "known"}
        assert store.watched.n("GET") == 3

    def test_trusts_nothing_of_a_store_that_tells_no_etag(self, store, done, tmp_path, monkeypatch):
        monkeypatch.setattr(sources, "_stamp", lambda _file: "")
        assert states(fleet(done, tmp_path)) == {"SN1": "known", "SN2": "known"}
        assert store.watched.n("GET") == 8

    def test_trusts_nothing_that_changed_while_it_was_fetched(self, store, texts, monkeypatch):
        head, rows = texts["setting_10.csv"]
        store.put("race/log.csv", head + rows)
        honest = sources.shutil.copyfileobj

        def overtaken(*given):
            honest(*given)
            store.put("race/log.csv", head)

        monkeypatch.setattr(sources.shutil, "copyfileobj", overtaken)
        with sources.brought_here(find_sources([store.address("race/log.csv")])) as (_, stamps):
            assert list(stamps.values()) == [""]


def test_what_cannot_be_fetched_is_left_for_the_next_run(runs, tmp_path, monkeypatch):
    def down(*_arguments):
        raise OSError("host unreachable")

    with monkeypatch.context() as patch:
        patch.setattr(sources, "_fetched", down)
        done = fleet([runs], tmp_path)
    assert {one.state for one in done} == {State.LATER}
    assert "host unreachable" in str(done[0].failures[0])
    assert not list(Path(tmp_path).rglob("*.parquet"))
    assert {one.state for one in fleet([runs], tmp_path)} == {State.FITTED}


def test_who_asks_is_part_of_an_address_and_of_no_path(monkeypatch):
    asked = []
    monkeypatch.setattr(sources, "_file_system", asked.append)
    with sources._reached("gs://anonymous@bench/runs/a@b.csv?scheme=http") as (_, path, form):
        assert asked == ["gs://anonymous@bench?scheme=http&retry_limit_seconds=3"]
        assert path == "bench/runs/a@b.csv"
        assert form.format(path) == "gs://anonymous@bench/runs/a@b.csv?scheme=http"


def test_an_address_with_a_secret_is_refused_and_the_secret_not_repeated():
    says = r"^s3://\.\.\.@bench/runs: .*AWS_SECRET"
    with pytest.raises(ConfigurationError, match=says) as raised:
        find_sources(["s3://KEY:hushhush@bench/runs"])
    assert not any(word in str(raised.value) for word in ("hush", "KEY:"))


def test_logs_of_one_name_in_two_folders_stay_apart(store, texts):
    put, address = store.put, store.address
    for folder, name in (("mon", "setting_01.csv"), ("tue", "setting_10.csv")):
        put(f"{folder}/runs/log.csv", "".join(texts[name]))
    found = find_sources([address("mon/runs"), address("tue/runs")])
    assert [one.name for one in found] == ["log.csv", "log.csv"]
    with sources.brought_here(found) as (here, _):
        contents = {path.read_bytes() for path in here.values()}
    assert contents == {"".join(texts[name]).encode() for name in texts}
