"""Logs in an object store: found, fetched, and what a network refuses is tried again."""

from __future__ import annotations

from pathlib import Path

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.fleet import sources
from damperfit.fleet.one_damper import State
from damperfit.fleet.parts import collect
from damperfit.fleet.sources import find_sources
from damperfit.fleet.whole_fleet import planned, run_fleet
from tests.fleet.test_fleet_command import Here

CONFIGURATION = load_configuration(None)
BUCKET = "bench"


@pytest.fixture(scope="module")
def store():
    """A store on this machine with two dampers in it; yields what makes an address of a path."""
    server = pytest.importorskip("moto.server")
    boto3 = pytest.importorskip("boto3")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "testing")
        patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        running = server.ThreadedMotoServer(port=0, verbose=False)
        running.start()
        host, port = running.get_host_and_port()
        client = boto3.client("s3", endpoint_url=f"http://{host}:{port}")
        client.create_bucket(Bucket=BUCKET)
        query = f"?scheme=http&endpoint_override={host}:{port}&region=us-east-1"

        def put(key: str, text: str) -> None:
            client.put_object(Bucket=BUCKET, Key=key, Body=text.encode())

        yield put, lambda path: f"s3://{BUCKET}/{path}{query}"
        running.stop()


@pytest.fixture(scope="module")
def runs(store, texts):
    """The address of the logs of two dampers, and texts beside them that are none."""
    put, address = store
    for serial in ("D1", "D2"):
        for name, (head, rows) in texts.items():
            put(f"runs/{serial}/{name}", head + rows)
    put("runs/README.md", "no log")
    return address("runs")


def test_a_folder_of_a_store_is_searched_like_one_of_the_disk(runs):
    found = find_sources([runs])
    assert [one.name for one in found] == [
        f"{serial}/setting_{k}.csv" for serial in ("D1", "D2") for k in ("01", "10")
    ]
    assert all(one.is_remote for one in found)


def test_a_pattern_and_a_single_log_are_found_in_a_store(runs, store):
    _, address = store
    (one,) = find_sources([address("runs/D2/setting_1*.csv")])
    assert one.file == "setting_10.csv"
    (one,) = find_sources([address("runs/D1/setting_01.csv")])
    assert one.name == "setting_01.csv"


def test_logs_of_a_store_give_what_the_same_logs_give_from_the_disk(runs, three, tmp_path):
    remote, local = tmp_path / "remote", tmp_path / "local"
    done = list(run_fleet(CONFIGURATION, planned(CONFIGURATION, [runs], remote), remote, Here()))
    assert [one.state for one in done] == [State.FITTED, State.FITTED]
    logs = [str(three / name) for name in ("D1", "D2")]
    tasks = planned(CONFIGURATION, [str(three)], local)
    assert len(logs) == 2
    list(run_fleet(CONFIGURATION, tasks[:2], local, Here()))
    assert collect(remote).equals(collect(local))
    again = list(run_fleet(CONFIGURATION, planned(CONFIGURATION, [runs], remote), remote, Here()))
    assert {one.state for one in again} == {State.KNOWN}


def test_a_request_that_fails_is_made_again(runs, monkeypatch):
    (first, *_) = find_sources([runs])
    honest, tries = sources._bytes, []

    def failing(source):
        tries.append(source)
        if len(tries) < 4:
            raise OSError("connection reset")
        return honest(source)

    monkeypatch.setattr(sources, "_bytes", failing)
    monkeypatch.setattr(sources, "_PAUSE", 0.0)
    with sources.brought_here([first]) as here:
        assert here[first].read_bytes() == honest(first)
        folder = here[first]
    assert len(tries) == 4
    assert not folder.exists()


def test_what_cannot_be_fetched_is_left_for_the_next_run(runs, tmp_path, monkeypatch):
    tasks = planned(CONFIGURATION, [runs], tmp_path)

    def down(_source):
        raise OSError("host unreachable")

    with monkeypatch.context() as patch:
        patch.setattr(sources, "_bytes", down)
        patch.setattr(sources, "_PAUSE", 0.0)
        done = list(run_fleet(CONFIGURATION, tasks, tmp_path, Here()))
    assert {one.state for one in done} == {State.LATER}
    assert "cannot be fetched, tried 4 times: host unreachable" in done[0].failures[0]
    assert not list(Path(tmp_path).rglob("*.parquet"))
    done = list(run_fleet(CONFIGURATION, tasks, tmp_path, Here()))
    assert {one.state for one in done} == {State.FITTED}


def test_logs_of_one_name_in_two_folders_stay_apart(store, texts):
    put, address = store
    for folder, name in (("mon", "setting_01.csv"), ("tue", "setting_10.csv")):
        put(f"{folder}/runs/log.csv", "".join(texts[name]))
    found = find_sources([address("mon/runs"), address("tue/runs")])
    assert [one.name for one in found] == ["log.csv", "log.csv"]
    with sources.brought_here(found) as here:
        contents = {path.read_bytes() for path in here.values()}
    assert contents == {"".join(texts[name]).encode() for name in texts}
