"""Binary logs of a `Scenario`, made with the libraries that rigs and scripts use."""

import io
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import pytest
from scipy import io as scipy_io

from tests.io import mdf_writer
from tests.io.scenarios import Scenario

CHANNELS = {"time": "s", "displacement": "mm", "force": "N", "temperature": "degC"}


def needs(*modules: str) -> None:
    """Skip a test whose libraries are not installed, without loading them: a child does."""
    for module in modules:
        if find_spec(module) is None:
            pytest.skip(f"{module} is not installed")


def arrays(scenario: Scenario) -> dict[str, np.ndarray]:
    return {
        "time": np.array(scenario.time),
        "displacement": np.array(scenario.displacement_mm),
        "force": np.array(scenario.force_n),
        "temperature": np.array(scenario.temperature),
    }


def matlab(scenario: Scenario, *, is_packed: bool = True) -> bytes:
    """Column vectors beside what a script left over; the unit in the variable's name."""
    variables = {f"{name}_{CHANNELS[name]}": v[:, None] for name, v in arrays(scenario).items()}
    left_over = {"f": 1.5, "T": 0.667, "tt": np.arange(33.0), "title": "run 3", "c": [1, "x"]}
    sink = io.BytesIO()
    content = {**variables, "setting": np.full((len(scenario.time), 1), float(scenario.setting))}
    scipy_io.savemat(sink, {**content, **left_over}, do_compression=is_packed)
    return sink.getvalue()


def matlab_unpacked(scenario: Scenario) -> bytes:
    return matlab(scenario, is_packed=False)


def matlab_73(scenario: Scenario) -> bytes:
    """HDF5 after 512 bytes; MATLAB's columns are rows."""
    import h5py

    sink = io.BytesIO()
    with h5py.File(sink, "w", userblock_size=512) as file:
        columns = {f"{name}_{CHANNELS[name]}": v for name, v in arrays(scenario).items()}
        columns["setting"] = np.full(len(scenario.time), float(scenario.setting))
        for name, values in columns.items():
            file[name] = values[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["note"] = np.frombuffer("five!".encode("utf-16-le"), np.uint16)[None, :]
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
        file["f"] = np.array([[1.5]])
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124, b" ") + b"\x00\x02IM"
    return head + sink.getvalue()[len(head) :]


def tdms(scenario: Scenario, *, group: str = "run") -> bytes:
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    sink = io.BytesIO()
    with TdmsWriter(sink) as writer:
        root = RootObject({"setting": str(scenario.setting), "operator": "A. B."})
        channels = [
            ChannelObject(group, name, values, {"unit_string": CHANNELS[name]})
            for name, values in arrays(scenario).items()
        ]
        writer.write_segment([root, GroupObject(group), *channels])
    return sink.getvalue()


def tdms_waveform(scenario: Scenario) -> bytes:
    """No time channel: an interval; an event channel of text beside; two segments."""
    from nptdms import ChannelObject, RootObject, TdmsWriter

    sink = io.BytesIO()
    step = scenario.time[1] - scenario.time[0]
    wave = {"wf_increment": step, "wf_start_offset": scenario.time[0]}
    with TdmsWriter(sink) as writer:
        for part in (slice(None, 2), slice(2, None)):
            channels = [
                ChannelObject("run", name, values[part], {"unit_string": CHANNELS[name], **wave})
                for name, values in arrays(scenario).items()
                if name != "time"
            ]
            events = ChannelObject("run", "event", ["start", "\xb5"])
            root = RootObject({"setting": scenario.setting})
            writer.write_segment([root, *channels, events])
    return sink.getvalue()


def mdf(scenario: Scenario) -> bytes:
    data = arrays(scenario)
    time = data.pop("time")
    ones = np.full(len(time), float(scenario.setting))
    named = [(name, CHANNELS[name], values) for name, values in data.items()]
    return mdf_writer.written((time, [*named, ("setting", "", ones)]))


def excel(scenario: Scenario) -> bytes:
    """A sheet of remarks, a sheet of data with a names row and a units row."""
    import openpyxl

    book = openpyxl.Workbook()
    book.active.title = "remarks"
    book.active.append(["Damper on rig 3"])
    sheet = book.create_sheet("data")
    sheet.append(["Setting", scenario.setting])
    sheet.append([])
    sheet.append([None, *(name.capitalize() for name in CHANNELS)])
    sheet.append([None, *CHANNELS.values()])
    for row in scenario.rows():
        sheet.append([None, *row])
    sheet["G1"] = "=SUM(B5:B9)"
    sink = io.BytesIO()
    book.save(sink)
    return sink.getvalue()


WRITERS: dict[str, tuple[str, Callable[[Scenario], bytes], tuple[str, ...]]] = {
    "MATLAB 7": ("log.mat", matlab, ()),
    "MATLAB 6": ("log.mat", matlab_unpacked, ()),
    "MATLAB 7.3": ("log.mat", matlab_73, ("h5py",)),
    "TDMS": ("log.tdms", tdms, ("nptdms",)),
    "TDMS waveform": ("log.tdms", tdms_waveform, ("nptdms",)),
    "MDF": ("log.mf4", mdf, ("asammdf",)),
    "Excel": ("log.xlsx", excel, ("openpyxl", "python_calamine")),
    "Excel called CSV": ("log.csv", excel, ("openpyxl", "python_calamine")),
}
