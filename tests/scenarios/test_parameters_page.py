"""The page of parameters is the sheets', and the sheets are what a flight is built from."""

from pathlib import Path
from typing import Any

import pytest

from dockair.parameters import load_parameters, read_sheet, sheet_names
from dockair.scenarios.assembly import measured, parts, receiver
from dockair.scenarios.parameters_page import parameters_page
from dockair.scenarios.schema import load_scenario
from dockair.sim.camera import sheets

UNMANNED = {"flight.altitude_m": 3000.0}
PAGE = Path(__file__).parents[2] / "docs" / "parameters.md"


def test_the_committed_page_is_what_the_sheets_make() -> None:
    assert PAGE.read_text(encoding="utf-8") == parameters_page()


def test_every_parameter_has_one_row_under_its_sheet_with_its_source() -> None:
    sections = dict(part.split("\n", 1) for part in parameters_page().split("\n## ")[1:])
    assert sorted(sections) == sheet_names()
    for sheet, text in sections.items():
        rows = [line for line in text.splitlines() if line.startswith("| `")]
        assert [row.split("`")[1] for row in rows] == list(read_sheet(sheet))
        for row, parameter in zip(rows, read_sheet(sheet).values(), strict=True):
            assert row.replace("\\|", "|").endswith(f"| {parameter.status} | {parameter.source} |")
            assert row.replace("\\|", "").count("|") == 7  # six cells: nothing in them breaks the table


def test_numbers_are_told_as_they_are_and_tables_by_their_span() -> None:
    page = parameters_page()
    assert "| `length_m` | 15 | m | 10 to 23 | published |" in page
    assert "| `acceleration_limit_m_s2` | 0.8, 3, 6 | m/s^2 | 0.1 to 10 | assumed |" in page
    assert "| `damping` | 9 x 12 numbers, -38.3 to 2.91 | 1 | -50 to 50 | published |" in page


def test_every_sheet_fills_the_class_that_a_flight_is_built_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights with every choice of hardware are built with each load recorded: all sheets, each in one class."""
    loaded: dict[str, set[type[Any]]] = {}

    def recording(sheet: str, cls: type[Any], overrides: Any = None) -> Any:
        loaded.setdefault(sheet, set()).add(cls)
        return load_parameters(sheet, cls, overrides)

    for module in (parts, measured, receiver):
        monkeypatch.setattr(module, "load_parameters", recording)
    monkeypatch.setattr(sheets, "load_parameters", recording)
    monkeypatch.setattr(parts, "SETTLE_S", 0.0)
    choices = (
        {"camera.filter": "long_pass", "hardware.imu": "mti"},
        {"camera.filter": "band_pass", "hardware.imu": "tactical"},
        {"hardware.imu": "consumer", "hardware.airframe": "unmanned", "flight.airspeed_m_s": 120.0, **UNMANNED},
        {"camera.sensing": "measurements"},
    )
    for choice in choices:
        parts.build(load_scenario("default", choice), 0)
    assert sorted(loaded) == sheet_names()
    assert [len(classes) for classes in loaded.values()] == [1] * len(loaded)
