"""The racetrack of the heading's reproduction: its motion against closed forms, and a short flight in the world."""

import json

import numpy as np
import pytest

from dockair.nav.heading.turn import TurnStatus
from dockair.rotations import log
from dockair.scenarios.reproduce import registry
from dockair.scenarios.reproduce.heading import flight as heading_flight
from dockair.scenarios.reproduce.heading.flight import Seen, SeenAgain, own_attitudes
from dockair.scenarios.reproduce.heading.formation import Formation, Racetrack

DEGREE = np.pi / 180.0
G = 9.80665


@pytest.fixture(scope="module")
def formation():
    return Formation(Racetrack(duration_s=200.0, starts_s=20.0, leg_s=30.0, shaking_deg=(0.0, 0.0, 0.0)))


def test_it_is_registered():
    assert "heading/racetrack" in registry.ids()


def test_a_turn_is_of_180_degrees_at_the_rate_of_its_bank_in_either_direction(formation):
    """g tan(25 deg) / V = 1.456 deg/s."""
    rate = G * np.tan(25.0 * DEGREE) / 180.0
    assert np.diff(formation.headings_rad)[8000] * 100.0 == pytest.approx(rate, rel=1e-3)
    straight = ~formation.is_turning & (formation.time_s > 100.0)
    assert formation.headings_rad[straight][0] == pytest.approx(np.pi, abs=0.01 * DEGREE)
    right = Formation(Racetrack(duration_s=60.0, starts_s=20.0, turns_left=False, shaking_deg=(0.0, 0.0, 0.0)))
    assert right.headings_rad[-1] == pytest.approx(-formation.headings_rad[6000], abs=1e-9)


def test_the_rates_turn_each_attitude_into_the_next_and_the_force_is_that_of_the_bank(formation):
    R, w = formation.attitudes_R_WB, formation.rates_rad_s
    for k in (0, 2500, 8000):
        np.testing.assert_allclose(log(R[k].T @ R[k + 1]) * 100.0, w[k], atol=1e-9)
    assert np.linalg.norm(formation.specific_forces_m_s2[8000]) == pytest.approx(G / np.cos(25.0 * DEGREE), rel=1e-3)
    assert abs(formation.specific_forces_m_s2[8000][1]) < 0.01 * G  # coordinated
    assert w[8000][2] == pytest.approx(np.linalg.norm(w[8000]) * R[8000][2, 2], rel=1e-6)


def test_gusts_shake_the_receiver_by_what_is_asked():
    """600 s of 1.5 s twice filtered: some 150 independent values, 6 % in rms; bound four of these."""
    shaken = Formation(Racetrack(duration_s=600.0, starts_s=600.0, shaking_deg=(0.2, 0.3, 1.0)))
    R = shaken.attitudes_R_WB
    roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    assert np.degrees(roll.std()) == pytest.approx(1.0, rel=0.25)
    assert np.degrees(shaken.headings_rad.std()) == pytest.approx(0.2, rel=0.25)


def test_the_aircraft_s_own_roll_and_pitch_are_wrong_by_tenths_of_a_degree_and_have_no_yaw(formation):
    R = own_attitudes(formation)
    assert np.abs(R[:, 1, 0]).max() < 1e-12
    up = np.einsum("ni,ni->n", R[:, 2], formation.attitudes_R_WB[:, 2])
    wrong = np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))
    assert 0.1 < np.sqrt(np.mean(wrong**2)) < 1.0


def test_what_was_seen_once_is_seen_again_and_a_gyro_stands_in_for_refused_frames():
    statuses = (TurnStatus.MEASURED, TurnStatus.TOO_FEW, TurnStatus.MEASURED)
    again = SeenAgain(Seen(np.array([1, 2, 3]), statuses, np.array([0.1, 0.0, 0.2]), np.eye(3)))
    for _ in range(3):
        again.step(np.zeros((1, 1), np.uint8), predicted_turn_rad=0.05)
    assert again.heading_rad == pytest.approx(0.35)


@pytest.mark.slow
def test_a_turn_in_the_world_is_seen_and_costs_the_heading_a_fifth_of_what_it_costs_the_raw_gyro(monkeypatch, tmp_path):
    """110 s with most of a turn, 55 frames of the half hour's 900; a frame's error there is 0.034 degrees rms.

    The heading at the end is no measure in so short a time: the raw MTi gyro's error passes through zero by then.
    """
    track = Racetrack(duration_s=110.0, starts_s=40.0)
    monkeypatch.setattr(heading_flight, "Racetrack", lambda: track)
    monkeypatch.setattr(heading_flight, "SEEDS", 1)
    table = registry.reproduce("heading/racetrack", tmp_path)
    assert json.loads(json.dumps(table))["id"] == "heading/racetrack"
    assert (tmp_path / "heading-racetrack.png").stat().st_size > 10_000
    sight = table["rows"][0]["ours"]
    assert sight["refused"] <= 1
    assert sight["rms_turns_deg"] < 0.08 and abs(sight["mean_turns_deg"]) < 0.03
    for row in table["rows"][1:]:
        ours = row["ours"]
        assert ours["gained_in_turns_raw_deg"] > 5.0 * ours["gained_in_turns_vdr_deg"], row["case"]
        assert ours["vdr_most_in_turns_deg"] < 1.0, row["case"]
