"""Damaged TDMS and Parquet: the numbers of the whole file or a refusal, never others in silence.

Parquet's pages have checksums, so no flipped bit may change a number. TDMS has none: a bit flipped
in a stored value is another value, which no reader can know and a note says. All else that a bit
may do there, to lengths, kinds, names and places, may change no number.
"""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_logs
from damperfit.recording import Recording
from tests.io import binary_logs
from tests.io.scenarios import Scenario, parquet_bytes, parquet_table

SCENARIO = Scenario()
CHANNELS = ("time", "displacement", "force")
HARD = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def _read(path, data: bytes, options: ReadOptions = ReadOptions()) -> tuple[Recording, ...]:
    """Return what is read of the bytes; nothing where they are refused."""
    path.write_bytes(data)
    try:
        return read_logs(path, options)
    except LogError:
        return ()


def _changed(good: Recording, found: Recording) -> set[tuple[str, int]]:
    """Return channel and place of every number that is another; (channel, -1): another length."""
    places = set()
    for channel in CHANNELS:
        expected, values = getattr(good, channel), getattr(found, channel)
        if len(values) != len(expected):
            places.add((channel, -1))
        else:
            places.update((channel, int(i)) for i in np.flatnonzero(values != expected))
    return places


def _flipped(data: bytes, bits) -> bytes:
    damaged = bytearray(data)
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


def _tdms_writers():
    pytest.importorskip("nptdms")
    return {"TDMS": binary_logs.tdms, "TDMS waveform": binary_logs.tdms_waveform}


@pytest.mark.parametrize("stride", [pytest.param(19), pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["TDMS", "TDMS waveform"])
def test_a_flipped_bit_in_tdms_changes_its_own_value_at_most(tmp_path, name, stride) -> None:
    # Used to give 4 of 5 rows, or displacements of 1e18 mm, when a length or a kind was flipped.
    data = _tdms_writers()[name](SCENARIO)
    path = tmp_path / "log.tdms"
    (good,) = _read(path, data)
    assert "TDMS has no checksums: a damaged value could not be seen" in good.notes
    n_refused = n_same = n_changed = 0
    for bit in range(0, 8 * len(data), stride):
        found = _read(path, _flipped(data, [bit]))
        if len(found) != 1:  # more: a time that jumps begins another test, and is told
            n_refused += not found
            continue
        if any(one.name == "own_rows" for one in found[0].findings):
            continue  # a start or a rate of one channel, which is a warning
        places = _changed(good, found[0])
        assert len(places) <= 1, (bit, places)
        assert ("time", -1) not in places
        n_same, n_changed = n_same + (not places), n_changed + bool(places)
    assert min(n_refused, n_same, n_changed) > 500 // stride


@pytest.mark.parametrize("stride", [pytest.param(13), pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["TDMS", "TDMS waveform", "Parquet"])
def test_a_cut_never_changes_a_number(tmp_path, name, stride) -> None:
    if name == "Parquet":
        data, path = parquet_bytes(parquet_table(SCENARIO)), tmp_path / "log.parquet"
    else:
        data, path = _tdms_writers()[name](SCENARIO), tmp_path / "log.tdms"
    (good,) = _read(path, data)
    between = data.rfind(b"TDSm")  # a file cut between two segments is whole
    for n in range(0, len(data), stride):
        if n != between:
            assert _read(path, data[:n]) == ()
        for found in _read(path, data[:n], ReadOptions(allow_truncated=True)):
            kept = len(found.time)
            for channel in CHANNELS:
                np.testing.assert_array_equal(
                    getattr(found, channel), getattr(good, channel)[:kept]
                )


@pytest.mark.parametrize("how", ["plain", "no dictionary", "second version", "packed"])
def test_no_flipped_bits_in_parquet_change_a_number(tmp_path, how) -> None:
    options = {
        "plain": {"compression": "none"},
        "no dictionary": {"compression": "none", "use_dictionary": False},
        "second version": {"compression": "none", "data_page_version": "2.0"},
        "packed": {},
    }[how]
    data = parquet_bytes(parquet_table(SCENARIO), **options)
    path = tmp_path / "log.parquet"
    (good,) = _read(path, data)

    @HARD
    @given(st.lists(st.integers(0, 8 * len(data) - 1), min_size=1, max_size=6, unique=True))
    def attempt(bits) -> None:
        for found in _read(path, _flipped(data, bits)):
            assert _changed(good, found) == set()

    attempt()


def test_every_changed_value_of_tdms_is_one_whose_bytes_were_changed(tmp_path) -> None:
    # Three of the format's channels, values that look like nothing else in the file.
    data = _tdms_writers()["TDMS"](SCENARIO)
    path = tmp_path / "log.tdms"
    (good,) = _read(path, data)
    columns = binary_logs.arrays(SCENARIO)
    starts = {channel: data.index(columns[channel].tobytes()) for channel in CHANNELS}

    @HARD
    @given(st.lists(st.integers(0, 8 * len(data) - 1), min_size=1, max_size=6, unique=True))
    def attempt(bits) -> None:
        hit = {bit // 8 for bit in bits}
        found = _read(path, _flipped(data, bits))
        for channel, place in _changed(good, found[0]) if len(found) == 1 else ():
            start = starts[channel] + 8 * place
            assert hit.intersection(range(start, start + 8))

    attempt()


def test_whole_numbers_that_no_float_holds_are_refused(tmp_path) -> None:
    # Doubles whose kind was damaged to 64-bit integers are such numbers.
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        columns = {"time_s": [0, 1, 2], "displacement_mm": [1, 2, 3], "force_N": [1, 2**53 + 2, 3]}
        writer.write_segment(
            [nptdms.ChannelObject("run", k, np.array(v, np.int64)) for k, v in columns.items()]
        )
    path = tmp_path / "log.tdms"
    path.write_bytes(sink.getvalue())
    with pytest.raises(LogError, match=r"log\.tdms: 'force_N' holds whole numbers beyond"):
        read_logs(path)
