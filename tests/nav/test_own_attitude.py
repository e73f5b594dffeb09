"""Roll and pitch from own gyros and accelerometers: closed forms of straight flight and steady turns."""

import numpy as np
import pytest

from dockair.calibration import Mounting
from dockair.messages import ImuSample
from dockair.nav.heading.own_attitude import OwnAttitude
from dockair.rotations import Array, log, matrix_from_yaw_pitch_roll

G, V, RATE_HZ = 9.80665, 180.0, 100.0
PLAIN = Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3))


def flown(attitude: OwnAttitude, seconds: float, w_B: Array, f_B: Array, R_BI: Array = PLAIN.R_BI) -> None:
    times = np.arange(1, round(seconds * RATE_HZ) + 1) / RATE_HZ
    attitude.propagate(
        [
            ImuSample(time_stamp_s=float(t), angular_rate_rad_s=R_BI.T @ w_B, specific_force_m_s2=R_BI.T @ f_B)
            for t in times
        ]
    )


def angle_deg(R: Array, expected: Array) -> float:
    return float(np.degrees(np.linalg.norm(log(expected.T @ R))))


def test_at_rest_it_is_what_gravity_says():
    R_LB = matrix_from_yaw_pitch_roll(0.0, -0.08, 0.1)
    attitude = OwnAttitude(PLAIN, V, 20.0, 0.5)
    assert not attitude.is_known
    np.testing.assert_array_equal(attitude.R_LB, np.eye(3))
    flown(attitude, 1.0, np.zeros(3), R_LB.T @ [0.0, 0.0, G])
    assert attitude.is_known and angle_deg(attitude.R_LB, R_LB) < 1e-6


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bank_in_a_steady_turn_is_no_level_flight(side):
    """Banked by 25 degrees what it feels points along its own z axis; the airspeed tells the turn."""
    bank = side * np.radians(-25.0)  # left wing down turns to the left
    R_LB = matrix_from_yaw_pitch_roll(0.0, 0.0, bank)
    turn = -G * np.tan(bank) / V
    mounting = Mounting(
        R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3), R_BI=matrix_from_yaw_pitch_roll(0.3, -0.2, 0.1)
    )
    attitude = OwnAttitude(mounting, V, 20.0, 0.5)
    flown(attitude, 30.0, R_LB.T @ [0.0, 0.0, turn], np.array([0.0, 0.0, G / np.cos(bank)]), mounting.R_BI)
    assert angle_deg(attitude.R_LB, R_LB) < 0.01


def test_bias_across_the_vertical_is_found_and_leaves_no_error():
    bias = np.radians([0.2, -0.3, 0.0])
    attitude = OwnAttitude(PLAIN, 1e-6, 10.0, 0.5)
    flown(attitude, 15.0, bias, np.array([0.0, 0.0, G]))
    early = angle_deg(attitude.R_LB, np.eye(3))
    attitude = OwnAttitude(PLAIN, 1e-6, 10.0, 0.5)
    flown(attitude, 120.0, bias, np.array([0.0, 0.0, G]))
    assert 0.1 < early < 1.5 and angle_deg(attitude.R_LB, np.eye(3)) < 0.01
    np.testing.assert_allclose(attitude._bias_B, bias, rtol=0.01, atol=1e-6)


def test_a_yaw_gyro_s_bias_tilts_it_until_vision_corrects_it():
    """0.2 degrees/s of bias ask for 0.63 m/s^2 of lift that is not there: 3.7 degrees of roll, none when corrected."""
    bias = np.array([0.0, 0.0, np.radians(0.2)])
    ends = []
    for correction in (0.0, -bias[2]):
        attitude = OwnAttitude(PLAIN, V, 10.0, 0.5)
        times = np.arange(1, 6001) / RATE_HZ
        samples = [
            ImuSample(time_stamp_s=float(t), angular_rate_rad_s=bias, specific_force_m_s2=np.array([0.0, 0.0, G]))
            for t in times
        ]
        attitude.propagate(samples, correction)
        ends.append(angle_deg(attitude.R_LB, np.eye(3)))
    assert ends[0] == pytest.approx(np.degrees(np.arctan2(V * bias[2], G)), rel=0.05)
    assert ends[1] < 0.02


def test_samples_without_numbers_or_out_of_order_are_passed_over():
    attitude = OwnAttitude(PLAIN, V, 20.0, 0.5)
    flown(attitude, 1.0, np.zeros(3), np.array([0.0, 1.0, G]))
    before = attitude.R_LB
    bad = [
        ImuSample(time_stamp_s=1.01, angular_rate_rad_s=np.full(3, np.nan), specific_force_m_s2=np.ones(3)),
        ImuSample(time_stamp_s=1.02, angular_rate_rad_s=np.ones(3)),
        ImuSample(time_stamp_s=0.5, angular_rate_rad_s=np.ones(3), specific_force_m_s2=np.ones(3)),
        ImuSample(time_stamp_s=9.0, angular_rate_rad_s=np.ones(3), specific_force_m_s2=np.ones(3)),  # after a gap
    ]
    attitude.propagate(bad)
    np.testing.assert_array_equal(attitude.R_LB, before)
