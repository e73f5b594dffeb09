"""Vision drift reduction on the oval of [Kyung et al. 2015]: no lap lost, no jump, left as right."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.heading.hdr import HeuristicDriftReduction
from dockair.nav.heading.vdr import VisionDriftReduction, VisionDriftSettings
from dockair.scenarios.reproduce.heading.tracks import (
    BIAS_RAD_S,
    RATE_HZ,
    oval_rates_rad_s,
    oval_true_rates_rad_s,
    straight_rates_rad_s,
)

DEGREE = np.pi / 180.0


def _fly(rates, visual, heading=0.0, **settings):
    vdr = VisionDriftReduction(RATE_HZ, VisionDriftSettings(**settings), heading)
    headings, switch = np.empty(rates.size), np.empty(rates.size, bool)
    for i, rate in enumerate(rates):
        headings[i] = vdr.step(float(rate), visual.get(i))
        switch[i] = vdr.is_turning
    return headings, switch


def _visual(true_rates, every_s, sigma_deg, seed):
    """What a visual heading of that error would say now and then; its errors are independent."""
    heading = np.cumsum(true_rates) / RATE_HZ
    rng = np.random.default_rng(seed)
    return {
        int(i): float(heading[i] + np.radians(sigma_deg) * rng.standard_normal())
        for i in range(0, heading.size, round(every_s * RATE_HZ))
    }


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(3))
def test_two_laps_are_kept_to_a_degree_with_the_source_s_visual_error(seed, side):
    """Per-point error of 0.6 degrees mean is a sigma of 0.75; the source's own mean heading error is 5.7 degrees."""
    rates, true = oval_rates_rad_s(seed, noise_deg_s=0.1)
    rates, true = side * (rates - BIAS_RAD_S) + BIAS_RAD_S, side * true
    headings, switch = _fly(rates, _visual(true, 1.0, 0.75, seed))
    error = headings - np.cumsum(true) / RATE_HZ
    assert np.abs(error).mean() < 1.0 * DEGREE
    assert np.abs(error[-1]) < 2.0 * DEGREE
    assert switch.any() and not switch.all()
    # what a sample adds is the rate and the permitted correction: the switch never makes it jump
    assert np.abs(np.diff(headings) * RATE_HZ - rates[1:]).max() < 5.0 * DEGREE + 1.2 * np.ptp(rates - true)


def test_left_and_right_are_mirror_images():
    """The gyro's bias mirrored too: bit for bit."""
    rates, true = oval_rates_rad_s(1, noise_deg_s=0.1)
    visual = _visual(true, 1.0, 0.5, 1)
    left, _ = _fly(rates, visual)
    right, _ = _fly(-rates, {i: -heading for i, heading in visual.items()})
    np.testing.assert_array_equal(left, -right)


def test_a_late_switch_makes_good_what_the_heuristic_took_for_drift():
    """Perfect vision: the turn up to the switch comes back, though the heading does not jump."""
    rates, true = oval_rates_rad_s(0, noise_deg_s=0.05)
    headings, switch = _fly(rates, _visual(true, 0.5, 0.0, 0))
    error = headings - np.cumsum(true) / RATE_HZ
    closes = np.flatnonzero(~switch[:-1] & switch[1:] & (np.arange(switch.size - 1) > 40 * RATE_HZ))[0]
    assert abs(error[closes] - error[closes - 600]) > 0.3 * DEGREE  # of it is lost when the switch closes
    assert abs(error[closes + 200] - error[closes - 600]) < 0.15 * DEGREE


def test_without_vision_it_is_the_heuristic_alone():
    """Their integrals differ by the low-pass's lag alone: at most its time constant times the filtered rate."""
    rates, _ = oval_rates_rad_s(0, noise_deg_s=0.1)
    headings, switch = _fly(rates, {}, heading=0.3)
    assert not switch.any()
    corrected = np.cumsum(HeuristicDriftReduction(RATE_HZ).run(rates)) / RATE_HZ
    lag = 0.3 + corrected - headings
    assert np.abs(lag).max() < 1.0 * 5.0 * DEGREE
    straight = round(16.0 * RATE_HZ)  # at rest by then but for the bias, which I has taken
    assert abs(lag[straight]) < 0.3 * DEGREE


def test_vision_that_ends_in_the_turn_opens_the_switch_without_a_jump():
    rates, true = oval_rates_rad_s(0, noise_deg_s=0.05)
    visual = {i: heading for i, heading in _visual(true, 1.0, 0.0, 0).items() if i < 45 * RATE_HZ}
    headings, switch = _fly(rates, visual)
    assert switch[round(44 * RATE_HZ)] and not switch[round(50 * RATE_HZ)]
    assert np.abs(np.diff(headings)).max() < 0.15 * DEGREE


def test_on_the_straight_drift_is_told_from_a_turn_and_is_learnt():
    rates = straight_rates_rad_s(5, noise_deg_s=0.1)
    headings, _ = _fly(rates, _visual(np.zeros(rates.size), 1.0, 0.0, 0))
    assert abs(headings[-1]) < 0.3 * DEGREE and np.abs(headings).max() < 1.0 * DEGREE
    vdr = VisionDriftReduction(RATE_HZ)
    for i, rate in enumerate(rates):
        vdr.step(float(rate), 0.0 if i % 100 == 0 else None)
    assert vdr.correction_rad_s == pytest.approx(-BIAS_RAD_S, abs=0.02 * DEGREE)


class Heuristic:
    """Heuristic drift reduction whose correction is set by hand."""

    def __init__(self, correction_rad_s):
        self.correction_rad_s = correction_rad_s

    def step(self, rate_rad_s):
        return rate_rad_s


@pytest.mark.parametrize(("vision_says_rad_s", "kept_rad_s"), [(0.002, 0.001), (0.008, 0.009)])
def test_after_a_turn_the_correction_of_its_beginning_or_end_is_kept_that_vision_is_nearer_to(
    vision_says_rad_s, kept_rad_s
):
    vdr = VisionDriftReduction(RATE_HZ, VisionDriftSettings(visual_share=1.0))
    vdr._hdr = Heuristic(0.001)
    vdr.step(-0.1, 0.0)
    for k in range(1, 1001):
        vdr.step(0.1, (0.1 + vision_says_rad_s) * k / RATE_HZ)
        vdr._hdr.correction_rad_s = 0.009
    assert vdr.is_turning
    vdr.step(-0.1)
    assert vdr.correction_rad_s == kept_rad_s


def test_the_switch_closes_after_its_time_and_opens_when_vision_is_too_old():
    """Theta is 1 s, 100 samples of one sign; the last visual heading comes with sample 150 of the run."""
    vdr = VisionDriftReduction(RATE_HZ, VisionDriftSettings(turn_after_s=1.0, oldest_visual_s=2.0))
    vdr._hdr = Heuristic(0.0)
    vdr.step(-0.1, 7.0)
    turning = []
    for k in range(1, 501):
        vdr.step(0.1, 7.0 + 0.1 * k / RATE_HZ if k <= 150 else None)
        turning.append(vdr.is_turning)
    closed = 1 + np.flatnonzero(turning)
    assert closed[0] == 100 and abs(closed[-1] - 350) <= 1  # 200 periods of 0.01 s, added up
    assert len(closed) == closed[-1] - 99


def test_what_the_heading_is_behind_it_makes_good_at_the_rate_allowed():
    """Vision turns by 0.5 rad more; the gyro goes on with the correction of the turn's beginning."""
    settings = VisionDriftSettings(turn_after_s=1.0, correction_rate_rad_s=0.2, visual_share=1.0)
    vdr = VisionDriftReduction(RATE_HZ, settings)
    vdr._hdr = Heuristic(0.01)
    vdr.step(-0.1, 0.0)
    headings = []
    for k in range(1, 201):
        headings.append(vdr.step(0.1, 0.5 + 0.1 * k / RATE_HZ))
        vdr._hdr.correction_rad_s = -0.04
    steps = RATE_HZ * np.diff(headings)
    np.testing.assert_allclose(steps[:98], 0.1 - 0.04, atol=1e-9)
    np.testing.assert_allclose(steps[98:], 0.1 + 0.01 + 0.2, atol=1e-9)


def test_from_where_vision_counts_does_not_matter():
    rates, true = oval_rates_rad_s(3, noise_deg_s=0.1)
    visual = {k: heading for k, heading in _visual(true, 1.0, 0.3, 3).items() if k < 4000}
    moved = {k: 5.0 + heading for k, heading in visual.items()}
    np.testing.assert_allclose(_fly(rates[:4000], moved)[0], _fly(rates[:4000], visual)[0], atol=1e-9)


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_of_a_new_visual_heading_its_share_is_taken(share):
    """0.4 rad farther in the middle of a turn, nothing between the two: what differs is the share of that."""
    rates = np.append(-0.1, np.full(800, 0.1))
    one, other = (
        _fly(
            rates,
            {0: 0.0, 600: 0.6 + more},
            turn_after_s=1.0,
            visual_share=share,
            correction_rate_rad_s=1e6,
            oldest_visual_s=1e6,
        )[0]
        for more in (0.0, 0.4)
    )
    np.testing.assert_array_equal(one[:600], other[:600])
    np.testing.assert_allclose((other - one)[600:], 0.4 * share, rtol=1e-9)


def test_the_initial_heading_is_added_once():
    rates, true = oval_rates_rad_s(2, noise_deg_s=0.1)
    visual = _visual(true, 1.0, 0.3, 2)
    np.testing.assert_allclose(_fly(rates, visual, heading=1.0)[0], 1.0 + _fly(rates, visual)[0], atol=1e-9)


def test_turns_shorter_than_the_threshold_are_the_gyro_s():
    true = np.concatenate([np.zeros(3000), np.full(300, 0.2), np.zeros(3000)])
    headings, switch = _fly(true, {i: 99.0 for i in range(0, 6300, 100)})  # vision that is plainly wrong
    assert not switch[3000:3480].any()
    assert headings[3480] == pytest.approx(0.6, abs=0.05)


@pytest.mark.parametrize(
    ("where", "make"),
    [
        ("turn_after_s", lambda: VisionDriftSettings(turn_after_s=0.0)),
        ("correction_rate_rad_s", lambda: VisionDriftSettings(correction_rate_rad_s=float("nan"))),
        ("oldest_visual_s", lambda: VisionDriftSettings(oldest_visual_s=-1.0)),
        ("heading_rad", lambda: VisionDriftReduction(heading_rad=float("nan"))),
        ("visual_heading_rad", lambda: VisionDriftReduction().step(0.0, float("nan"))),
        ("rate_rad_s", lambda: VisionDriftReduction().step(float("nan"))),
    ],
)
def test_what_cannot_be_is_refused_by_name(where, make):
    with pytest.raises(DockairError, match=where):
        make()


def test_the_track_is_two_laps():
    assert oval_true_rates_rad_s().sum() / RATE_HZ == pytest.approx(4.0 * np.pi)
