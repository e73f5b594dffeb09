"""Digests of what decides a flight."""

from dockair.scenarios.scenario_hash import scenario_hash
from dockair.scenarios.schema import load_scenario


def test_the_digest_changes_with_what_decides_the_flight_and_with_nothing_else():
    digest = scenario_hash(load_scenario("default"))
    for same in ({"seed": 5}, {"claim": "another"}, {"accept.outcome": "miss"}):
        assert scenario_hash(load_scenario("default", same)) == digest
    others = {"turbulence.sigma_m_s": 0.51, "navigation.navigator": "truth", "parameters.reel.tension_gain": 0.6}
    for key, value in others.items():
        assert scenario_hash(load_scenario("default", {key: value})) != digest


def test_the_digest_sees_into_the_sheets_that_the_scenario_names(tmp_path):
    sheet = tmp_path / "ring.toml"
    sheet.write_text("a = 1")
    scenario = load_scenario("default", {"hardware.ring": str(sheet)})
    before = scenario_hash(scenario)
    sheet.write_text("a = 2")
    assert scenario_hash(scenario) != before


def test_the_digest_does_not_see_how_the_path_of_a_sheet_is_written(tmp_path, monkeypatch):
    """The same flight by a plan in another folder, or asked for from another one, is the same."""
    (tmp_path / "ring.toml").write_text("a = 1")
    monkeypatch.chdir(tmp_path)
    paths = ["ring.toml", str(tmp_path / "ring.toml"), "../" + tmp_path.name + "/ring.toml"]
    assert len({scenario_hash(load_scenario("default", {"hardware.ring": path})) for path in paths}) == 1
