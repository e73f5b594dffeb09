"""Numbers that the filter starts from, against what is said of them beside the settings."""

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.nav.belief_motion import BIAS, CALIBRATION, ERRORS, FORMATION, PHI, PLACE, REST, RING, propagated
from dockair.nav.fusion_settings import FusionSettings, motion_of, start_of

SETTINGS = FusionSettings()
GYRO = GyroSheet(
    rate_hz=250,
    noise_density_rad_s_rthz=1.7e-4,
    bias_sigma_rad_s=3.5e-3,
    scale_factor_sigma=2e-3,
    accelerometer_noise_density_m_s2_rthz=6e-4,
    accelerometer_bias_sigma_m_s2=0.3,
)
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.array([6.0, -0.9, 0.6]), p_BI=np.array([1.0, 0.3, -0.2]))
SHEETS = NavigationSheets(
    camera=Camera(),
    ring=LedRing(),
    mounting=MOUNTING,
    start=StartGeometry(
        p_PD_B=np.array([8.0, 0.3, -0.2]),
        sigma_p_m=np.array([0.1, 0.2, 0.3]),
        R_BD=np.eye(3),
        sigma_R_rad=np.array([0.01, 0.02, 0.03]),
    ),
    gyro=GYRO,
    camera_rate_hz=50,
    control_rate_hz=100,
    coupling_depth_m=0.3,
)


def test_an_error_of_a_second_is_noise_of_twice_its_variance_times_that():
    """Of the scale factor; of a rate that is not known, 0.05 rad/s for a quarter of a second."""
    motion = motion_of(SETTINGS, GYRO)
    assert motion.scale2 == pytest.approx(2.0 * 2e-3**2 * 1.0)
    assert motion.held_most2 == pytest.approx(2.0 * 0.05**2 * 0.25)


def test_a_rate_that_is_held_is_off_by_its_sigma_after_its_time():
    assert np.sqrt(motion_of(SETTINGS, GYRO).held_turn2) * 0.25 == pytest.approx(0.05)


def test_the_drogue_turns_by_as_much_as_is_said():
    """0.8 degrees rms about its attitude of rest, which walks by 0.3 degrees in 10 s; the LEDs' places by 0.03 mm."""
    motion = motion_of(SETTINGS, GYRO)
    assert np.sqrt(motion.attitude2 / (2.0 * motion.return_1_s)) == pytest.approx(np.deg2rad(0.8), rel=0.03)
    assert motion.return_1_s == pytest.approx(1.0 / 0.6)
    assert np.sqrt(10.0 * motion.rest2) == pytest.approx(np.deg2rad(0.3), rel=0.03)
    assert np.sqrt(10.0 * motion.ring2) == pytest.approx(3e-5, rel=0.06)


def test_at_the_start_the_drogue_has_turned_for_ever_about_an_attitude_of_rest_that_the_sheet_knows():
    """The way to rest is as uncertain a second later, and rest = attitude and way there as the sheet says."""
    P = start_of(SETTINGS, SHEETS).P
    to_rest = np.zeros((3, ERRORS))
    to_rest[:, PHI] = to_rest[:, REST] = np.eye(3)
    np.testing.assert_allclose(to_rest @ P @ to_rest.T, np.diag([1e-4, 4e-4, 9e-4]), atol=1e-12)
    silent = motion_of(SETTINGS, GYRO)._replace(gyro2=0.0, scale2=0.0, held_turn2=0.0, bias2=0.0, rest2=0.0)
    turning = np.zeros((ERRORS, ERRORS))
    turning[REST, REST] = P[REST, REST]
    still = np.arange(251) / 250.0, np.zeros((251, 3)), np.zeros((251, 3))
    after = propagated(np.eye(3), np.zeros((8, 3)), turning, 0.0, 1.0, *still, silent.flat())[2]
    np.testing.assert_allclose(after[REST, REST], P[REST, REST], rtol=0.01)


def test_at_the_start_all_else_is_as_uncertain_as_settings_and_sheets_say():
    start = start_of(SETTINGS, SHEETS)
    sigma = np.sqrt(np.diag(start.P))
    np.testing.assert_allclose(start.p_ID, [13.0, -0.9, 0.6])
    np.testing.assert_allclose(sigma[PLACE], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(sigma[BIAS], 3.5e-3)
    np.testing.assert_allclose(sigma[FORMATION], np.hypot(0.5, 0.3))  # the accelerometers' bias is part of it
    axes, place = 9.4e-4, 2e-3
    np.testing.assert_allclose(sigma[CALIBRATION][:6], np.repeat([axes, place], 3))
    np.testing.assert_allclose(sigma[RING], 3e-4)
