"""The public names, literally: a name that comes, goes or moves is a decision made here.

Public are the modules of `damperfit` that stand in `SURFACE`. What a package offers is imported
from the package; its inner modules are its own affair.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections import Counter

import pytest

import damperfit

SURFACE = {
    "damperfit": [
        "__version__",
    ],
    "damperfit.run.run_json": [
        "Ending",
        "Judgement",
        "ending_of",
        "failures_of",
        "identity_of",
        "json_values",
        "log_documents",
        "provenance",
        "reading_ending",
        "record",
        "report_facts",
    ],
    "damperfit.export": [
        "ExportOptions",
        "HandedOver",
        "HandedSetting",
        "TARGETS",
        "Target",
        "Tested",
        "find_target",
        "hand_over",
    ],
    "damperfit.queries.adjuster_results": ["AdjusterResults", "adjuster_in", "read_adjuster"],
    "damperfit.queries.force_by_setting": [
        "ForceTable",
        "Question",
        "parse_question",
        "tabulate_forces",
    ],
    "damperfit.run.readings": ["Readings"],
    "damperfit.adjustment": [
        "Adjustment",
        "Answer",
        "Click",
        "Level",
        "Outlier",
        "STROKES",
        "Sine",
        "Stage",
        "Trend",
        "TrendPoint",
        "Wanted",
        "beside_measured",
        "clicks",
        "compare_settings",
        "credible_forces",
        "fastest_sine",
        "find_trends",
        "levels",
        "named_speeds",
        "sine_of",
        "stage_of",
        "which_setting",
    ],
    "damperfit.atomic": [
        "FileSet",
        "check_writable",
        "file_set",
        "reserved",
        "settle",
        "write_text",
    ],
    "damperfit.checks": [
        "CHECKS",
        "CHECK_LISTS",
        "Check",
        "Subject",
        "expand_checks",
        "missed_gates",
        "run_checks",
        "unchecked",
    ],
    "damperfit.cli": [
        "main",
    ],
    "damperfit.conditioning": [
        "ConditionOptions",
        "GasFacts",
        "NominalTest",
        "apply_filter",
        "branch_forces",
        "clean_cycles",
        "condition",
        "design_filter",
        "differentiate",
        "examine_raw",
        "figures_of",
        "noise_floor",
    ],
    "damperfit.run.trust": [
        "confidence_record",
        "ladder_advice",
        "unconfirmed_tares",
    ],
    "damperfit.configuration.loading": [
        "configuration_toml",
        "load_configuration",
        "redeclared",
    ],
    "damperfit.damper.purdy.appendices": [
        "LinearValves",
        "Tube",
        "bump_flows",
        "bump_pressures",
        "compliance_factor",
        "dilute_modulus",
        "effective_modulus",
        "gas_piston_displacement",
        "high_pressure_limit",
        "low_pressure_limit",
        "mixture_modulus",
        "rebound_flows",
        "rebound_pressures",
        "simple_force",
        "simple_slopes",
        "tube_modulus",
        "volume_fractions",
    ],
    "damperfit.damper.purdy.bulk_modulus": [
        "gas_modulus",
        "modulus_at_pressure",
    ],
    "damperfit.damper.purdy.closed_forms": [
        "DESIGN_COLUMNS",
        "gas_pressure",
        "incompressible_design",
        "incompressible_force",
    ],
    "damperfit.damper.purdy": [],
    "damperfit.damper.purdy.cavitation": ["examine_cavitation"],
    "damperfit.damper.purdy.integration": ["SENSITIVITY_NAMES", "integrate"],
    "damperfit.damper.purdy.quantities": ["OF_OIL", "OIL", "QUANTITIES"],
    "damperfit.damper.purdy.starting": [
        "REBOUND",
        "cavitation_limit",
        "detours",
        "starting_values",
        "starts",
    ],
    "damperfit.damper.cavitation": [
        "Cavitation",
        "describe_cavitation",
        "emptiest",
        "seen_cavitation",
    ],
    "damperfit.damper.models": [
        "MODELS",
        "model_named",
    ],
    "damperfit.configuration.damper_section": [
        "DAMPER_SECTIONS",
        "DamperSection",
        "damper_defaults",
    ],
    "damperfit.damper.model": [
        "DAMPER",
        "Detour",
        "LOG",
        "Model",
        "Quantity",
        "RIG",
        "SETTING",
        "Values",
        "values_type",
    ],
    "damperfit.laws": [
        "ENOUGH_PERCENT",
        "Ladder",
        "LawFit",
        "Rung",
        "SettingLogs",
        "Tried",
        "UNTOLD",
        "Verdict",
        "climb",
        "effective_samples",
        "fit_law",
        "in_words",
        "judged",
        "opening_force",
        "physics_seen",
        "rank_rivals",
    ],
    "damperfit.run.given_starts": [
        "start_of_laws",
        "with_given_start",
    ],
    "damperfit.run.law_choice": [
        "LAYOUTS",
        "LawChoice",
        "choose_law",
        "with_chosen_law",
    ],
    "damperfit.damper.cylinder": [
        "Cylinder",
    ],
    "damperfit.damper.force_channel": [
        "behind_lag",
        "lag_slope",
    ],
    "damperfit.damper.mounting": [
        "FIT",
        "Mounting",
        "NONE",
    ],
    "damperfit.damper.valve_curves": [
        "Loop",
        "Side",
        "ValveCurve",
        "ValveReading",
        "loop_of",
        "read_valves",
    ],
    "damperfit.damper.valve_dampers": [
        "AMBIENT",
        "Monotube",
        "ThroughFlow",
        "TwinTube",
        "VALVE_RANGES",
        "ValveDamper",
    ],
    "damperfit.damper.valve_starts": [
        "read_strokes",
        "valve_starts",
    ],
    "damperfit.damper.rivals": [
        "BesingerCebonCole",
        "Bilinear",
        "Biviscous",
        "BoucWen",
        "Degressive",
        "FourSlopes",
        "HagedornWallaschek",
        "KaradayiMasada",
        "Kwok",
        "Linear",
        "PolynomialInSpeed",
        "PolynomialInStrokeAndSpeed",
        "RIVALS",
        "RestoringForceSurface",
        "Rival",
        "SuraceWordenTomlinson",
    ],
    "damperfit.damper.network_model": [
        "simulate_network",
    ],
    "damperfit.damper.network": [
        "BLEEDS",
        "BLOW_OFFS",
        "BODY_NUMBERS",
        "MOST_NUMBERS",
        "MOST_PASSAGES",
        "Network",
        "Passage",
        "Valve",
        "monotube",
        "purdy",
        "purdy_blow_off",
        "through_flow",
        "twin_tube",
    ],
    "damperfit.damper.purdy.parameters": [
        "DAMPER_RANGES",
        "Damper",
        "PURDY_DAMPER",
        "Parameters",
    ],
    "damperfit.damper.purdy.reference": [
        "REFERENCE_SETTINGS",
        "REFERENCE_SOURCE",
        "reference_parameters",
    ],
    "damperfit.errors": [
        "ConditioningError",
        "ConfigurationError",
        "ContradictionError",
        "DamperfitError",
        "InstallationError",
        "InternalError",
        "LogError",
        "Mishap",
        "OutputError",
        "QualityError",
        "SimulationError",
        "TimelessError",
        "did_you_mean",
        "mishap_of",
        "sparing",
    ],
    "damperfit.identification": [
        "Campaign",
        "Comparison",
        "Fit",
        "FitOptions",
        "GivenStart",
        "LogFit",
        "Outcome",
        "PROCEDURES",
        "Search",
        "SettingFailure",
        "Sharing",
        "Status",
        "Valley",
        "check_options",
        "check_start",
        "compare",
        "describe_searches",
        "identify",
        "normalised_mse",
        "shared_names",
    ],
    "damperfit.run.hold_out": [
        "Parted",
        "fitting",
        "named_files",
        "note_unpredicted",
        "part",
    ],
    "damperfit.run.logs": [
        "LogBatch",
        "LogFacts",
        "available_cores",
        "expand",
        "failure_of",
        "read_batch",
    ],
    "damperfit.run.judging": [
        "assessed",
        "judge",
        "with_profiles",
    ],
    "damperfit.run.earlier": [
        "FIGURES",
        "PAGE",
        "forget_figures",
    ],
    "damperfit.run.mishaps": [
        "Mishaps",
    ],
    "damperfit.run.remarks": [
        "MANY",
        "corrections",
        "gates_not_met",
        "missing_logs",
        "run_warnings",
        "skipped_files",
    ],
    "damperfit.identity": [
        "IDENTITY_KEYS",
        "Identity",
        "common_identity",
        "identity_in",
    ],
    "damperfit.configuration.what_is_tested": [
        "COUNTED",
        "TestOptions",
        "TestSection",
        "check_adjusters",
        "declared_settings",
    ],
    "damperfit.run.log_paths": [
        "matches",
    ],
    "damperfit.run.work": [
        "Clock",
        "comparisons",
        "fitted",
        "profile_points",
        "sha256_of",
    ],
    "damperfit.run.labelling": [
        "GUESSED",
        "Labels",
        "labels_for",
    ],
    "damperfit.run.same_setting": [
        "once_each",
        "without_contradictions",
        "without_copies",
    ],
    "damperfit.run.dampers": [
        "by_damper",
        "folder_name",
        "of_one_damper",
    ],
    "damperfit.run.pipeline": [
        "Watch",
        "find_each",
        "run",
        "run_each",
    ],
    "damperfit.run.result": [
        "Found",
        "RunResult",
        "UnwrittenError",
    ],
    "damperfit.statistics": [
        "CHI_SQUARED_95",
        "NORMAL_95",
    ],
    "damperfit.quantities": [
        "QuantityError",
        "Unit",
        "engineering",
        "find_unit",
        "is_unit",
        "parse_quantity",
        "says_absolute_or_gauge",
        "units_of",
    ],
    "damperfit.readers": [
        "ForceCurve",
        "Guess",
        "Profile",
        "ReadOptions",
        "TestRow",
        "TestsTable",
        "guess_settings",
        "is_tests_table",
        "read_curves",
        "read_log",
        "read_logs",
        "read_tests",
    ],
    "damperfit.recording": [
        "Drive",
        "FilterDesign",
        "Finding",
        "Recording",
        "SEVERITIES",
        "Stretch",
        "StretchFigures",
        "Trace",
        "natural_order",
    ],
    "damperfit.report": [
        "ASCII_LEVELS",
        "BLOCK_LEVELS",
        "Failure",
        "Plot",
        "ReportFacts",
        "ReportPlots",
        "Sheet",
        "SweepMember",
        "VERDICT_COLOURS",
        "check_lines",
        "chosen_records",
        "chosen_sheet",
        "curve_forces_sheet",
        "curve_sheet",
        "cycle_force_sheet",
        "cycle_pressure_sheet",
        "cycle_sparklines",
        "draw_loops",
        "draw_plot",
        "failure_lines",
        "finding_lines",
        "force_by_setting_sheet",
        "force_by_speed_sheet",
        "held_out_sheet",
        "html_report",
        "inspection_sheet",
        "ladder_records",
        "ladder_sheet",
        "markdown_report",
        "measured_force_sheet",
        "parameter_sheet",
        "read_back",
        "report_plots",
        "rival_records",
        "rival_sheet",
        "short_listing",
        "sparkline",
        "stretch_sheet",
        "summary_sheet",
        "sweep_plot",
        "sweep_pressure_plot",
        "sweep_records",
        "sweep_sentence",
        "sweep_sheet",
        "terminal_table",
        "to_record",
    ],
    "damperfit.samples": [
        "SampleOptions",
        "SteadyCycle",
        "make_samples",
        "steady_cycle",
    ],
    "damperfit.configuration.schema": [
        "build_configuration",
    ],
    "damperfit.configuration.options": [
        "Configuration",
        "OutputOptions",
        "RigOptions",
        "SimulationOptions",
        "parameter_value",
    ],
    "damperfit.setting": [
        "ADJUSTER",
        "LONGEST_WORD",
        "Line",
        "Place",
        "Setting",
        "clicks_between",
        "lines_of",
        "nearest_setting",
        "parse_place",
        "parse_setting",
        "short_names",
    ],
    "damperfit.simulation": [
        "Characteristics",
        "Motion",
        "NAMED_SPEEDS",
        "Response",
        "SolverOptions",
        "SpeedForce",
        "Work",
        "characterise",
        "mean_figures",
        "motion_of",
        "refuse_amplitude",
        "signals_at_speeds",
        "simulate",
        "sine_motion",
        "triangle_motion",
    ],
    "damperfit.queries.sweep": [
        "Member",
        "PAPER_SWEEPS",
        "SWEPT_UNITS",
        "Variation",
        "parse_variation",
        "run_sweep",
    ],
    "damperfit.tables": [
        "LogSignals",
        "MISSING",
        "PAPER_QUANTITIES",
        "Results",
        "SCHEMA_VERSION",
        "Tables",
        "WITHHELD",
        "adjustment_rows",
        "characteristic_rows",
        "characteristics_table",
        "column_names",
        "describe_tables",
        "grade",
        "make_tables",
        "profiles_table",
        "quantities_in",
        "quantity_records",
        "read_facts",
        "read_known_numbers",
        "read_parameters",
        "read_results",
        "safe_cell",
        "table_quantities",
        "table_schema",
        "time_series_table",
        "values_from",
        "write_responses",
        "write_table",
    ],
    "damperfit.queries.measured_forces": [
        "MeasuredForces",
        "measured_forces",
    ],
    "damperfit.queries.one_simulation": [
        "Choice",
        "SimulatedTest",
        "choose_parameters",
        "damper_of",
        "simulate_test",
    ],
    "damperfit.queries.origin": [
        "Origin",
        "configured_as",
        "motion_of_tests",
        "origin_of",
    ],
    "damperfit.uncertainty": [
        "Assessment",
        "Bench",
        "Diagnosis",
        "GasContent",
        "Hint",
        "HoldOutOptions",
        "Interval",
        "Linearisation",
        "LogLinearisation",
        "METHOD",
        "MisfitProfile",
        "Objection",
        "Prediction",
        "ProfilePoint",
        "SpeedForces",
        "Stride",
        "Uncertainty",
        "assess",
        "check_profile_names",
        "diagnose",
        "linearise_at_fit",
        "linearise_settings",
        "objections",
        "predict",
        "prediction_warnings",
        "profile_campaign",
        "reconsider",
        "split_cycles",
        "uncertainties",
    ],
}


def names_in(package):
    """The modules straight inside a package, but for private ones and `__main__`."""
    inside = pkgutil.iter_modules(importlib.import_module(package).__path__, f"{package}.")
    return [module.name for module in inside if not module.name.split(".")[-1].startswith("_")]


def every_module():
    found = pkgutil.walk_packages(damperfit.__path__, "damperfit.")
    return sorted(module.name for module in found if not module.name.split(".")[-1].startswith("_"))


@pytest.mark.parametrize("module", SURFACE)
def test_the_public_names_are_these(module):
    assert sorted(importlib.import_module(module).__all__) == SURFACE[module]


# Rooms that offer nothing of their own: their modules are public one by one.
ROOMS = {
    "damperfit.configuration",
    "damperfit.damper",
    "damperfit.damper.purdy",
    "damperfit.queries",
    "damperfit.run",
}


def test_no_module_is_forgotten():
    rooms = {name for room in ROOMS for name in names_in(room)}
    assert set(names_in("damperfit")) - ROOMS | rooms == set(SURFACE) - {"damperfit"}


def test_every_name_has_one_import_path():
    times = Counter(name for names in SURFACE.values() for name in names)
    assert [name for name, count in times.items() if count > 1] == []


@pytest.mark.parametrize("module", SURFACE)
def test_public_things_are_defined_where_they_are_imported_from(module):
    for name in SURFACE[module]:
        thing = getattr(importlib.import_module(module), name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert f"{thing.__module__}.".startswith(f"{module}."), name


@pytest.mark.parametrize("module", SURFACE)
def test_public_things_are_documented(module):
    for name in SURFACE[module]:
        thing = getattr(importlib.import_module(module), name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert thing.__doc__, name


@pytest.mark.parametrize("module", every_module())
def test_every_module_says_what_it_offers(module):
    loaded = importlib.import_module(module)
    assert loaded.__doc__
    if module in ROOMS:
        return
    assert len(set(loaded.__all__)) == len(loaded.__all__)
    for name in loaded.__all__:
        assert hasattr(loaded, name), name
