"""The source's pose experiment: its table within sampling error, and the law behind its surfaces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dockair.scenarios.reproduce.pose.surface import angle
from dockair.scenarios.reproduce.pose.table3 import table3
from dockair.scenarios.reproduce.pose.trials import COLUMNS, DIAMETER, RADIUS, attitude, errors, rmse


def test_attitude_is_passive_about_z_then_y_then_x():
    roll, pitch, yaw = 0.1, -0.2, 0.3
    axes = (
        Rotation.from_rotvec([-roll, 0, 0]),
        Rotation.from_rotvec([0, -pitch, 0]),
        Rotation.from_rotvec([0, 0, -yaw]),
    )
    expected = (axes[0] * axes[1] * axes[2]).as_matrix()
    np.testing.assert_allclose(attitude(np.array([roll, pitch, yaw])), expected, atol=1e-15)


@pytest.mark.slow
def test_table_3_is_met_within_25_percent_when_its_size_is_a_radius():
    """500 trials scatter an RMSE by 3.2 %; x is printed to 1e-4 m, so half of that is allowed."""
    rows = [row for row in table3(None)["rows"] if row["case"].endswith(RADIUS.name)]
    assert len(rows) == 3
    for row in rows:
        for column in COLUMNS:
            ours, printed = row["ours"][column], row["reference"][column]
            assert abs(ours - printed) <= max(0.25 * printed, 0.5e-4 if column == "x_m" else 0.0), (row["case"], column)


@pytest.mark.slow
def test_only_x_tells_the_two_readings_apart():
    rows = [row for row in table3(None)["rows"] if row["case"].endswith(DIAMETER.name)]
    for row in rows:
        assert row["ours"]["x_over_reference"] < 0.75, row["case"]
        for name in ("y", "z", "roll", "pitch", "yaw"):
            assert 0.75 < row["ours"][f"{name}_over_reference"] < 1.25, (row["case"], name)


def test_angles_grow_with_range_squared_while_perspective_carries_them():
    """Noise a hundredth of the source's: far from where the two minima meet; 200 trials scatter each RMSE by 3.5 %."""
    quiet = type(RADIUS)(name="quiet", diameter_per_size=2.0, sigma_px=RADIUS.sigma_px / 100.0)
    rng = np.random.default_rng(1)
    near, far = (rmse(errors(quiet, 0.5, range_m, 200, rng)[0]) for range_m in (10.0, 20.0))
    np.testing.assert_allclose(far[4:] / near[4:], 4.0, rtol=0.2)
    np.testing.assert_allclose(far[1:3] / near[1:3], 8.0, rtol=0.2)


@pytest.mark.slow
def test_a_drogue_of_10_cm_is_far_worse_than_one_of_50_cm_at_every_end_of_the_surface():
    for row in angle(None)["rows"]:
        ours = row["ours"]
        for range_m in (25, 50):
            assert (
                ours[f"attitude_size_10_cm_at_{range_m}_m_deg"] > 1.7 * ours[f"attitude_size_50_cm_at_{range_m}_m_deg"]
            )
