"""The large swing's energy: read right from a swing made by hand; what it is in a small and a large one."""

import numpy as np
import pytest

from dockair.scenarios.reproduce.world import large_swing as world_large_swing


def by_hand(given_back):
    """z = A exp(-d t) cos(w t) on k = 100 N/m; the resistance takes what is lost and what is given back besides."""
    time_s = np.arange(8000) / 1000.0
    d, w, a = 0.02, 2.5, 2.0
    envelope = a * np.exp(-d * time_s)
    height = envelope * np.cos(w * time_s)
    stored = 50.0 * envelope**2
    lost_w = -np.gradient(stored, 1e-3)
    return world_large_swing.Swing(a, height, -lost_w / (1.0 - given_back)), 2.0 * np.pi / w, d


@pytest.mark.parametrize("given_back", [0.0, 0.6])
def test_swing_made_by_hand_is_weighed_right(given_back):
    swing, period_s, decay_1_s = by_hand(given_back)
    figures = world_large_swing.weigh(swing, 100.0, loop=0)
    assert figures["period_s"] == pytest.approx(period_s, abs=2e-3)
    assert figures["lost_in_a_period"] == pytest.approx(1.0 - np.exp(-decay_1_s * period_s), rel=2e-3)
    assert figures["given_back"] == pytest.approx(given_back, abs=5e-3)
    z = swing.height_m[swing.tops[:2]]
    assert figures["taken_j_per_m2"] * figures["amplitude_m"] ** 2 == pytest.approx(
        50.0 * (z[0] ** 2 - z[1] ** 2) / (1.0 - given_back), rel=5e-3
    )


@pytest.mark.slow
def test_a_large_swing_lasts_because_the_steady_air_gives_back_not_because_resistance_fades():
    stiffness = world_large_swing.stiffness_n_m()
    small, large = (world_large_swing.weigh(world_large_swing.let_go(a, 7.8), stiffness) for a in (0.3, -3.4))
    assert small["lost_in_a_period"] == pytest.approx(0.403, abs=0.005) and abs(small["given_back"]) < 0.1
    assert large["amplitude_m"] > 2.5 and large["lost_in_a_period"] < 0.1
    assert large["taken_j_per_m2"] > 1.2 * small["taken_j_per_m2"]
    assert 0.75 < large["given_back"] < 1.0
