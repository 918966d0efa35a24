"""A results folder with one setting of each kind, made from known numbers, no fit."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import Campaign, Outcome, SimulatedLog, compare
from damperfit.tables.columns import describe_tables, table_schema
from damperfit.tables.files import lay_out, write_responses, write_table
from damperfit.tables.rows import characteristic_rows, signals_of
from tests.fakes import campaign, fit, make_tables

EVIL = "</script><img src=x onerror=alert(1)>$x_1$.csv"


def make_results(folder: Path, settings: Iterable[int] = ()) -> Path:
    """Settings 1 good, 2 poor, 3 cavitating, 4 missing, 5 not identifiable with a vile name."""
    cavitating = fit(3, outcome=Outcome.CAVITATING)
    many = campaign(
        fit(1),
        fit(2, mse=12.0),
        replace(cavitating, parameters=replace(cavitating.parameters, r_m3=2e7)),
        fit(5, status={"k_e": "not_identifiable"}, logs=(EVIL,)),
    )
    if settings:
        many = campaign(*map(fit, settings))
    tables = make_tables(many, expected=settings or (1, 2, 3, 4, 5))
    rows = tables["parameters"].to_pylist()
    rows[0] |= {"k_e_se": 1e7, "k_e_ci_low": 4.9e8, "k_e_ci_high": 5.3e8}
    parameters = pa.Table.from_pylist(rows, schema=table_schema("parameters", {}))
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in (("parameters", parameters), ("mse", tables["mse"])):
        for suffix in (".parquet", ".csv"):
            write_table(folder / (name + suffix), table)
    pairs = [(one, log) for one in many.fits for log in one.logs]
    compared = [compare(one.parameters, log.trace, PURDY_DAMPER) for one, log in pairs]
    put_responses(folder / "responses.parquet", many, compared)
    rows = [
        row
        for (one, log), seen in zip(pairs, compared, strict=True)
        for row in characteristic_rows(one.setting, log.trace, seen, PURDY_DAMPER)
    ]
    characteristics = lay_out("characteristics", rows, settings=[one.setting for one in many.fits])
    write_table(folder / "characteristics.parquet", characteristics)
    forces = [
        {
            "setting": row["setting"],
            "speed_m_per_s": row["speed_rebound_m_per_s"],
            "stroke": stroke,
            "force_N": row[f"simulated_{stroke}_N"],
            "origin": "model",
        }
        for row in rows
        for stroke in ("rebound", "bump")
        if row["point"] == "speed"
    ]
    adjustment = lay_out("adjustment", forces, settings=[one.setting for one in many.fits])
    write_table(folder / "adjustment.parquet", adjustment)
    record = {
        "version": "0.1.0",
        "schema_version": 1,
        "schema": describe_tables(),
        "warnings": [f"{EVIL}: strange"],
        "gaps": [{"first": 4, "last": 4}],
        "procedure": ["Damper: rod 19 mm."],
        "inputs": [
            {"log": EVIL, "temperature_degC": 26.4, "notes": [f"note of {EVIL}"]},
            *(
                {"log": log.trace.name, "frequency_Hz": 1.5, "amplitude_m": 0.032}
                for _, log in pairs
                if log.trace.name != EVIL
            ),
        ],
    }
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    return folder


def put_responses(path: Path, done: Campaign, compared: Iterable[SimulatedLog]) -> None:
    """Write the signals of a campaign."""
    pairs = [(one, log) for one in done.fits for log in one.logs]
    write_responses(
        path,
        [
            signals_of(one.setting, log.trace, seen)
            for (one, log), seen in zip(pairs, compared, strict=True)
        ],
        settings=[one.setting for one in done.fits],
        quantities=done.quantities or PURDY_DAMPER.quantities,
    )


def damage_row_group(path: Path, group: int) -> None:
    """Turn bytes over in the middle of one row group."""
    with pq.ParquetFile(path) as file:
        column = file.metadata.row_group(group).column(4)
        start = column.dictionary_page_offset or column.data_page_offset
        size = column.total_compressed_size
    data = bytearray(path.read_bytes())
    for place in range(start + size // 2, start + size // 2 + 64):
        data[place] ^= 0xFF
    path.write_bytes(data)
