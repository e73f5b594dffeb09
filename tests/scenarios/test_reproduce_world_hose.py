"""The hose's reproductions: shape at rest, closed forms, swings, convergence."""

import json

import cv2
import numpy as np
import pytest

from dockair.scenarios.reproduce.world import convergence as world_convergence
from dockair.scenarios.reproduce.world import hose_checks as world_hose_checks
from dockair.scenarios.reproduce.world import static as world_static
from dockair.scenarios.reproduce.world import swing as world_swing
from dockair.scenarios.reproduce.world.hose_cases import HoseCase, continuous_cable


def _checked(result, folder, name):
    """Rows by case, of a result in the printed form with one picture."""
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert list(result) == ["id", "source", "rows"]
    for row in result["rows"]:
        assert row["reference"] and row["reference"].keys() <= row["ours"].keys(), row["case"]
    assert cv2.imread(str(folder / name)).std() > 10.0
    return {row["case"]: row for row in result["rows"]}


def test_continuous_cable_begins_at_the_exit_and_ends_with_the_drogues_pull():
    case = HoseCase.of(180.0, 6000.0)
    places, tensions = continuous_cable(case, 200)
    np.testing.assert_allclose(places[0], 0.0, atol=1e-12)
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert lengths.sum() == pytest.approx(case.hose.length_m, rel=1e-5)
    drag = 0.5 * case.air.density_kg_m3 * 180.0**2 * 0.8 * np.pi / 4.0 * 0.25
    assert tensions[-1] == pytest.approx(np.hypot(drag, 20.0 * 9.80665), rel=1e-12)


@pytest.mark.slow
def test_settled_chain_is_within_1_percent_of_the_published_parameters_solution_and_a_tenth_of_the_cable(tmp_path):
    rows = _checked(world_static.reproduce(tmp_path), tmp_path, "world-static.png")
    assert len(rows) == 6
    for row in rows.values():
        ours = row["ours"]
        for key, value in row["reference"].items():
            assert ours[key] == pytest.approx(value, rel=0.01), row["case"]
            for other in ("rest_", "cable_"):
                assert ours[other + key] == pytest.approx(ours[key], rel=1e-3), row["case"]


@pytest.mark.slow
def test_closed_forms_and_symmetries_hold(tmp_path):
    rows = _checked(world_hose_checks.reproduce(tmp_path), tmp_path, "world-hose-checks.png")
    relative = {"catenary": 1e-4, "critical": 1e-6, "drogue on": 1e-3}
    held = 0
    for name, row in rows.items():
        for start, tolerance in relative.items():
            if name.startswith(start):
                held += 1
                for key, value in row["reference"].items():
                    assert row["ours"][key] == pytest.approx(value, rel=tolerance), name
    assert held == 4
    rk4, world = (rows[name]["ours"] for name in rows if name.startswith("energy"))
    assert rk4["ratio"] > 16.0 and world["ratio"] == pytest.approx(2.0, rel=0.02)
    assert world["halved_drift_j"] < 1.5
    (towed,) = (row["ours"] for name, row in rows.items() if name.startswith("towed"))
    assert towed["swing_m"] > 0.5 and towed["largest_difference_m"] < 1e-9
    turned = [row["ours"] for name, row in rows.items() if name.startswith("gravity")]
    assert len(turned) == 2 and all(ours["largest_difference_m"] < 3e-4 * ours["swing_m"] for ours in turned)


@pytest.mark.slow
def test_mujocos_swings_have_the_linearised_chains_period_within_a_thousandth_and_damping_within_a_hundredth(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(world_swing, "_MODES", 1)
    rows = _checked(world_swing.reproduce(tmp_path), tmp_path, "world-swing.png")
    assert len(rows) == 4
    for name, row in rows.items():
        assert row["ours"]["period_s"] == pytest.approx(row["reference"]["period_s"], rel=1e-3), name
        assert row["ours"]["damping_ratio"] == pytest.approx(row["reference"]["damping_ratio"], rel=1e-2), name


def test_fit_finds_the_period_and_damping_of_a_made_up_swing():
    time_s = np.arange(0.0, 5.0, 1e-3)
    path = 0.02 * np.exp(-0.2 * time_s) * np.cos(2.5 * time_s + 0.3)
    assert world_swing.fit(time_s, path, complex(-0.3, 2.2)) == pytest.approx(complex(-0.2, 2.5), rel=1e-9)


def test_gust_of_the_convergence_rides_the_air_and_has_the_spectrums_strength():
    gust = world_convergence.FrozenWaves.drawn(180.0, 15.0, 60.0)
    places = np.array([[-3.0, 0.0, 1.0], [-9.0, 2.0, 0.0]])
    later = gust.at(places - np.array([180.0 * 0.5, 0.0, 0.0]), 2.5)
    np.testing.assert_allclose(gust.at(places, 2.0), later, atol=1e-12)
    # 10.8 km of waves from 4000 m down to 15 m, which hold most of the variance: one draw is within a third
    assert np.all(np.abs(gust.velocity_m_s.std(axis=0) / 1.11 - 1.0) < 0.33)


@pytest.mark.slow
def test_default_links_and_rate_are_within_a_millimetre_of_much_finer_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(world_convergence, "_LINKS", (4, 18, 32))
    monkeypatch.setattr(world_convergence, "_RATES_HZ", (250, 1000, 2000))
    monkeypatch.setattr(world_convergence, "_FINEST_RATE_HZ", 4000)
    monkeypatch.setattr(world_convergence, "_DURATION_S", 6.0)
    monkeypatch.setattr(world_convergence, "_BEFORE_S", 2.0)
    rows = _checked(world_convergence.reproduce(tmp_path), tmp_path, "world-convergence.png")
    off = {name: row["ours"]["rms_from_finest_mm"] for name, row in rows.items()}
    assert len(off) == 6 and min(off.values()) > 0.01  # none is its own reference
    assert off["18 links, 1000 Hz"] < 1.0
    assert off["4 links, 1000 Hz"] > 5.0 * off["18 links, 1000 Hz"]
    assert off["250 Hz, 18 links"] > 2.0 * off["18 links, 1000 Hz"]
    default = rows["18 links, 1000 Hz"]
    for key in ("aft_m", "below_m", "root_tension_n", "vertical_period_s", "lateral_period_s", "lateral_rms_m"):
        assert default["ours"][key] == pytest.approx(default["reference"][key], rel=1e-3), key
