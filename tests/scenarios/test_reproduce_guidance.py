"""A drogue met at contact against one followed at all times."""

import numpy as np
import pytest

from dockair.scenarios.reproduce import guidance_path_plan as paths


def test_the_drogue_swings_as_widely_as_its_stationary_covariance_says():
    """Of s'' + 2 z w s' + w^2 s = g, T g' = -g + noise: rms by the integral of its spectrum."""
    swing = paths.SWING
    flights = np.concatenate([paths.drogue(np.random.default_rng(k))[0][1500:] for k in range(12)])
    w = 2.0 * np.pi * np.array(swing.frequency_hz)
    f = np.linspace(1e-4, 20.0, 40001)[:, np.newaxis]
    s = 2j * np.pi * f
    gust = np.array(swing.gust_density) / (s + 1.0 / np.array(paths.GUST_TIME_S))
    answer = gust / (s**2 + 2.0 * np.array(swing.damping) * w * s + w**2)
    rms = np.sqrt(2.0 * np.trapezoid(np.abs(answer) ** 2, f, axis=0))
    assert np.sqrt((flights**2).mean(axis=0))[1:] == pytest.approx(
        rms[1:], rel=0.25
    )  # three sigma of 12 flights of 35 s


@pytest.mark.slow
def test_what_is_met_at_contact_is_missed_by_less_than_what_is_followed():
    followed, fewer, met = (np.concatenate([paths.missed(way, k) for k in (0, 1, 2)]) for way in paths.WAYS)
    assert np.median(met) < 0.8 * np.median(followed)
    assert np.mean(met <= 0.15) > np.mean(fewer <= 0.15)
