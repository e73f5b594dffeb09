from dataclasses import dataclass

import numpy as np
import pytest

from dockair import parameters
from dockair.errors import DockairError
from dockair.parameters import load_parameters, read_sheet, sheet_names

ENTRY = '[{name}]\nvalue = {value}\nlow = {low}\nhigh = {high}\nunit = "m"\nsource = "{source}"\nstatus = "{status}"\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class Hose:
    length_m: float
    links: int
    offset_m: np.ndarray


def entry(
    name: str, value: object, low: object, high: object, source: str = "a book", status: str = "published"
) -> str:
    return ENTRY.format(name=name, value=value, low=low, high=high, source=source, status=status)


GOOD = entry("length_m", 15.0, 10.0, 25.0) + entry("links", 16, 10, 30) + entry("offset_m", [1.0, 2.0], 0.0, 5.0)


@pytest.fixture
def sheet(tmp_path, monkeypatch):
    """Write a sheet `hose` and make it the only one there is."""
    (tmp_path / "parameters").mkdir()
    monkeypatch.setattr(parameters, "files", lambda package: tmp_path)
    read_sheet.cache_clear()
    yield lambda text: (tmp_path / "parameters" / "hose.toml").write_text(text, encoding="utf-8")
    read_sheet.cache_clear()


def test_sheet_fills_the_dataclass(sheet):
    sheet(GOOD)
    hose = load_parameters("hose", Hose)
    assert (hose.length_m, hose.links) == (15.0, 16)
    np.testing.assert_array_equal(hose.offset_m, [1.0, 2.0])


def test_vectors_are_read_only(sheet):
    sheet(GOOD)
    with pytest.raises(ValueError, match="read-only"):
        load_parameters("hose", Hose).offset_m[0] = 0.0


def test_overrides_replace_values_and_keep_their_kind(sheet):
    sheet(GOOD)
    hose = load_parameters("hose", Hose, {"length_m": 20, "links": 20.0, "offset_m": [0.0, 5.0]})
    assert hose.length_m == 20.0 and isinstance(hose.length_m, float)
    assert hose.links == 20 and isinstance(hose.links, int)
    np.testing.assert_array_equal(hose.offset_m, [0.0, 5.0])


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("length_m", 30.0),
        ("length_m", 9.99),
        ("length_m", 10**400),
        ("length_m", float("nan")),
        ("length_m", "long"),
        ("length_m", "20"),
        ("offset_m", ["1.0", "2.0"]),
        ("offset_m", [True, 2.0]),
        ("length_m", [1.0, 2.0]),
        ("offset_m", 1.0),
        ("offset_m", [1.0, 2.0, 3.0]),
        ("offset_m", [1.0, 6.0]),
        ("links", 16.5),
        ("lenght_m", 15.0),
    ],
)
def test_wrong_override_is_refused_by_its_key(sheet, key, value):
    sheet(GOOD)
    with pytest.raises(DockairError) as error:
        load_parameters("hose", Hose, {key: value})
    assert error.value.where == f"parameters.hose.{key}"


@pytest.mark.parametrize(
    "bad",
    [
        entry("length_m", 15.0, 10.0, 25.0, source="  "),
        entry("length_m", 15.0, 10.0, 25.0, status="guessed"),
        entry("length_m", 26.0, 10.0, 25.0),
        entry("length_m", 15.0, 10.0, 25.0).replace('unit = "m"\n', ""),
    ],
    ids=["empty source", "unknown status", "value out of its range", "no unit"],
)
def test_wrong_sheet_is_refused_with_sheet_and_key(sheet, bad):
    sheet(bad)
    with pytest.raises(DockairError, match=r"hose\.toml: length_m"):
        read_sheet("hose")


@pytest.mark.parametrize("text", [GOOD + entry("more_m", 1.0, 0.0, 2.0), entry("links", 16, 10, 30)])
def test_sheet_and_dataclass_must_have_the_same_keys(sheet, text):
    sheet(text)
    with pytest.raises(DockairError, match="length_m"):
        load_parameters("hose", Hose)


@pytest.mark.parametrize("name", ["hoze", "../parameters/hose", "./hose", "h" * 300, "a\0b", ""])
def test_unknown_sheet_is_refused_with_the_known_ones(sheet, name):
    sheet(GOOD)
    with pytest.raises(DockairError) as error:
        read_sheet(name)
    assert error.value.exists == ("hose",)


@pytest.mark.parametrize("name", sheet_names())
def test_every_sheet_in_the_project_can_be_read(name):
    assert read_sheet(name)
