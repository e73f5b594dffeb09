"""Heuristic drift reduction: closed forms of its parts, the straight and the oval of [Kyung et al. 2015]."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.heading.hdr import HeuristicDriftReduction, HeuristicDriftSettings
from dockair.scenarios.reproduce.heading.tracks import oval_rates_rad_s, straight_rates_rad_s

RATE_HZ = 100.0
DEGREE = np.pi / 180.0


def _end_deg(rates_rad_s, **settings):
    hdr = HeuristicDriftReduction(RATE_HZ, HeuristicDriftSettings(**settings))
    return float(hdr.run(rates_rad_s).sum()) / RATE_HZ / DEGREE


def test_without_its_steps_the_printed_loop_is_the_low_pass_alone():
    """A step through a first-order low-pass by backward differences: w'_n = 1 - (tau / (T + tau))^n."""
    hdr = HeuristicDriftReduction(RATE_HZ, HeuristicDriftSettings(step_rad_s=0.0, time_constant_s=0.5))
    n = np.arange(1, 301)
    np.testing.assert_allclose(hdr.run(np.ones(300)), 1.0 - (0.5 / 0.51) ** n, rtol=1e-12)


def test_the_first_sample_of_a_run_steps_by_i_c_and_later_ones_by_less_as_stated():
    """No low-pass, so the sign that drives I is the sample's own; I after n equal signs is the sum of Eq. (3)."""
    s = HeuristicDriftSettings(time_constant_s=0.0, step_rad_s=1e-4, attenuation=0.5, exponent=2.0)
    hdr = HeuristicDriftReduction(RATE_HZ, s)
    hdr.run(np.full(21, 0.1))
    r = np.arange(1, 21)
    assert hdr.correction_rad_s == pytest.approx(-(1e-4 * 1.5 / (1.0 + 0.5 * r**2)).sum(), rel=1e-12)


def test_a_rate_of_zero_is_corrected_by_nothing():
    hdr = HeuristicDriftReduction(RATE_HZ)
    assert (hdr.run(np.zeros(500)) == 0.0).all() and hdr.correction_rad_s == 0.0


@pytest.mark.parametrize("rate_rad_s", [-0.2, 0.2])
@pytest.mark.parametrize("loop", ["printed", "closed"])
def test_a_turn_above_the_switch_is_left_alone(loop, rate_rad_s):
    hdr = HeuristicDriftReduction(RATE_HZ, HeuristicDriftSettings(loop=loop, time_constant_s=0.0, turn_rate_rad_s=0.1))
    hdr.run(np.full(1000, rate_rad_s))
    assert hdr.correction_rad_s == 0.0


def test_it_is_the_low_pass_that_tells_a_turn():
    """0.2 rad/s behind a low-pass of a second are 0.1 after 0.7 s: till then I goes on."""
    hdr = HeuristicDriftReduction(RATE_HZ, HeuristicDriftSettings(turn_rate_rad_s=0.1, step_rad_s=1e-6))
    corrections = []
    for _ in range(100):
        hdr.step(0.2)
        corrections.append(hdr.correction_rad_s)
    moved = np.flatnonzero(np.diff(corrections))
    assert moved[-1] == len(moved) - 1 and 0.66 * RATE_HZ < len(moved) < 0.72 * RATE_HZ


def test_the_closed_loop_gives_the_raw_rate_and_its_correction_whose_low_pass_drives_it():
    """0.1 rad/s corrected by -0.3: what comes out is -0.2 at once, without lag, so that the correction shrinks."""
    hdr = HeuristicDriftReduction(RATE_HZ, HeuristicDriftSettings(loop="closed", step_rad_s=1e-6))
    hdr.correction_rad_s = -0.3
    np.testing.assert_allclose(hdr.run(np.full(10, 0.1)), -0.2, atol=1e-5)
    assert hdr.correction_rad_s > -0.3


@pytest.mark.parametrize("loop", ["printed", "closed"])
def test_stepping_gives_the_record_s_bits_and_left_is_right_mirrored(loop):
    rates = straight_rates_rad_s(3, noise_deg_s=0.2)
    settings = HeuristicDriftSettings(loop=loop)
    stepped = HeuristicDriftReduction(RATE_HZ, settings)
    one_by_one = [stepped.step(float(rate)) for rate in rates]
    assert one_by_one == HeuristicDriftReduction(RATE_HZ, settings).run(rates).tolist()
    mirrored = HeuristicDriftReduction(RATE_HZ, settings).run(-rates)
    np.testing.assert_array_equal(mirrored, -np.array(one_by_one))


@pytest.mark.parametrize("noise_deg_s", [0.05, 0.1, 0.2, 0.5])
def test_sixteen_degrees_of_drift_on_the_straight_come_down_to_six_hundredths(noise_deg_s):
    """100 seeds, every one; the raw rate's own end is 16 degrees."""
    rates = [straight_rates_rad_s(seed, noise_deg_s=noise_deg_s) for seed in range(100)]
    assert np.sum(rates[0]) / RATE_HZ / DEGREE == pytest.approx(16.0, abs=0.6)
    assert max(abs(_end_deg(rate)) for rate in rates) <= 0.06


@pytest.mark.parametrize("noise_deg_s", [0.05, 0.5])
def test_with_the_same_constants_the_oval_s_turns_are_partly_lost(noise_deg_s):
    """Two laps: 720 degrees; the source reads about 576."""
    read = [_end_deg(oval_rates_rad_s(seed, noise_deg_s=noise_deg_s)[0]) for seed in range(20)]
    assert min(read) >= 500.0 and max(read) <= 690.0


def test_without_the_attenuator_turns_are_destroyed():
    assert _end_deg(oval_rates_rad_s(0, noise_deg_s=0.1)[0], attenuation=0.0) < 60.0


@pytest.mark.parametrize(
    ("where", "make"),
    [
        ("time_constant_s", lambda: HeuristicDriftSettings(time_constant_s=-1.0)),
        ("step_rad_s", lambda: HeuristicDriftSettings(step_rad_s=float("nan"))),
        ("turn_rate_rad_s", lambda: HeuristicDriftSettings(turn_rate_rad_s=0.0)),
        ("loop", lambda: HeuristicDriftSettings(loop="open")),
        ("sample_rate_hz", lambda: HeuristicDriftReduction(0.0)),
        ("rate_rad_s", lambda: HeuristicDriftReduction().step(float("nan"))),
        ("rates_rad_s", lambda: HeuristicDriftReduction().run(np.array([0.0, np.inf]))),
    ],
)
def test_what_cannot_be_is_refused_by_name(where, make):
    with pytest.raises(DockairError, match=where):
        make()


def test_a_refused_sample_changes_nothing():
    hdr, twin = HeuristicDriftReduction(), HeuristicDriftReduction()
    rates = straight_rates_rad_s(0, noise_deg_s=0.1)[:200]
    twin.run(rates)
    hdr.run(rates[:100])
    with pytest.raises(DockairError):
        hdr.step(float("inf"))
    hdr.run(rates[100:])
    assert hdr.correction_rad_s == twin.correction_rad_s
