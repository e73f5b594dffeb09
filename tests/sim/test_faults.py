"""Each kind of fault alone, at its first and last moment, and together with others."""

import math
from typing import Any

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.sim.faults import (
    CameraDropOut,
    CameraFault,
    DeadReel,
    DirtyWindow,
    ExposureStuck,
    Fault,
    Faults,
    GyroBiasStep,
    GyroDropOut,
    GyroSaturation,
    HotPixels,
    LedDim,
    LedFlicker,
    LedOff,
    StuckFrame,
    hot_pixel_places,
)

TIMES = {"start_s": 2.0, "stop_s": 5.0}
JUST_BEFORE_5 = math.nextafter(5.0, 0.0)


def _faults(*faults: Fault) -> Faults:
    return Faults(faults, led_count=8)


# One fault


@pytest.mark.parametrize(
    ("fault", "look", "ill", "healthy"),
    [
        (LedOff(leds=(3,), **TIMES), lambda f, t: f.led_factors(t)[3], 0.0, 1.0),
        (LedDim(leds=(3,), factor=0.3, **TIMES), lambda f, t: f.led_factors(t)[3], 0.3, 1.0),
        (LedFlicker(frequency_hz=9.0, duty=0.0, depth=0.4, **TIMES), lambda f, t: f.led_factors(t)[0], 0.6, 1.0),
        (CameraDropOut(**TIMES), lambda f, t: f.camera(t).dropped, True, False),
        (StuckFrame(**TIMES), lambda f, t: f.camera(t).stuck, True, False),
        (HotPixels(count=12, **TIMES), lambda f, t: f.camera(t).hot_pixels, 12, 0),
        (DirtyWindow(cover=0.25, **TIMES), lambda f, t: f.camera(t).dirt_cover, 0.25, 0.0),
        (ExposureStuck(exposure_s=4e-5, **TIMES), lambda f, t: f.camera(t).exposure_s, 4e-5, None),
        (GyroBiasStep(rate_rad_s=(0.0, 0.1, 0.0), **TIMES), lambda f, t: f.imu(t).bias_rad_s[1], 0.1, 0.0),
        (GyroSaturation(limit_rad_s=0.5, **TIMES), lambda f, t: f.imu(t).range_rad_s, 0.5, None),
        (GyroDropOut(**TIMES), lambda f, t: f.imu(t).dropped, True, False),
        (DeadReel(**TIMES), lambda f, t: f.reel_locked(t), True, False),
        (DeadReel(**TIMES), lambda f, t: f.reel_seen_dead(t), True, False),
        (DeadReel(unnoticed=True, **TIMES), lambda f, t: f.reel_locked(t), True, False),
        (DeadReel(unnoticed=True, **TIMES), lambda f, t: not f.reel_seen_dead(t), True, True),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Fault) else "",
)
def test_a_fault_acts_from_its_start_until_just_before_its_stop(
    fault: Fault, look: Any, ill: Any, healthy: Any
) -> None:
    faults = _faults(fault)
    assert look(faults, 2.0) == ill and look(faults, JUST_BEFORE_5) == ill
    assert look(faults, math.nextafter(2.0, 0.0)) == healthy and look(faults, 5.0) == healthy


def test_without_an_end_a_fault_lasts_for_ever_and_without_a_start_it_is_there_from_the_first_moment() -> None:
    faults = _faults(LedOff(leds=(0,)))
    assert faults.led_factors(0.0)[0] == 0.0 and faults.led_factors(1e6)[0] == 0.0


def test_no_faults_leave_everything_as_it_is() -> None:
    faults = _faults()
    assert not faults.any and _faults(StuckFrame(start_s=50.0)).any
    assert np.array_equal(faults.led_factors(1.0, 1e-3), np.ones(8))
    assert faults.camera(1.0) == CameraFault()
    imu = faults.imu(1.0)
    assert np.array_equal(imu.bias_rad_s, np.zeros(3)) and imu.range_rad_s is None and not imu.dropped


def test_a_fault_of_one_device_leaves_the_others_alone() -> None:
    leds, camera, imu = _faults(LedOff()), _faults(CameraDropOut(), HotPixels(count=3)), _faults(GyroDropOut())
    assert leds.camera(0.0) == imu.camera(0.0) == CameraFault()
    assert not leds.imu(0.0).dropped and not camera.imu(0.0).dropped
    assert not any(faults.reel_locked(0.0) for faults in (leds, camera, imu))
    assert _faults(DeadReel()).camera(0.0) == CameraFault() and not _faults(DeadReel()).imu(0.0).dropped
    assert (camera.led_factors(0.0) == 1.0).all() and (imu.led_factors(0.0) == 1.0).all()


def test_an_led_fault_is_of_the_leds_it_names_or_of_all() -> None:
    assert np.array_equal(_faults(LedOff(leds=(1, 6))).led_factors(0.0), [1, 0, 1, 1, 1, 1, 0, 1])
    assert np.array_equal(_faults(LedDim(factor=0.25)).led_factors(0.0), np.full(8, 0.25))


# Flicker


def test_a_flickering_led_is_on_first_for_its_duty_then_dark_by_its_depth() -> None:
    faults = _faults(LedFlicker(leds=(2,), frequency_hz=10.0, duty=0.3, depth=0.9, start_s=1.0))
    for period in range(3):
        for phase, expected in ((0.001, 1.0), (0.299, 1.0), (0.301, 0.1), (0.999, 0.1)):
            assert faults.led_factors(1.0 + 0.1 * (period + phase))[2] == pytest.approx(expected)


@pytest.mark.parametrize("exposure_s", [1e-6, 3e-3, 0.04, 0.1, 0.1234, 0.75])
def test_an_exposure_sees_the_mean_of_the_flicker_over_itself(exposure_s: float) -> None:
    """Against a sum over 1000 moments, which each edge of the flicker makes wrong by half a moment at most."""
    faults, moments = _faults(LedFlicker(frequency_hz=10.0, duty=0.3, depth=0.8)), (np.arange(1000) + 0.5) / 1000
    edges = 2.0 * (10.0 * exposure_s + 1.0)
    for middle in (1.0, 1.013, 1.029, 1.0305, 1.07):
        parts = [faults.led_factors(middle + exposure_s * (m - 0.5))[0] for m in moments]
        assert faults.led_factors(middle, exposure_s)[0] == pytest.approx(np.mean(parts), abs=0.8 * 5e-4 * edges)


def test_over_whole_periods_a_flicker_leaves_its_mean_whatever_the_phase() -> None:
    faults = _faults(LedFlicker(frequency_hz=50.0, duty=0.3, depth=0.8))
    for time_s in np.linspace(1.0, 1.02, 7):
        assert faults.led_factors(time_s, 3 / 50.0)[0] == pytest.approx(1.0 - 0.8 * 0.7, abs=1e-9)


def test_after_an_hour_a_short_exposure_still_sees_a_flicker_to_a_millionth() -> None:
    """Half of 20 us lies before the edge: 1 kHz, duty 1/2, an edge every half millisecond."""
    faults = _faults(LedFlicker(frequency_hz=1000.0, duty=0.5))
    assert faults.led_factors(3600.0005, 2e-5)[0] == pytest.approx(0.5, abs=1e-4)
    assert faults.led_factors(3600.00025, 2e-5)[0] == pytest.approx(1.0, abs=1e-6)
    assert faults.led_factors(3600.00075, 2e-5)[0] == pytest.approx(0.0, abs=1e-6)


# Several faults


def test_led_factors_multiply() -> None:
    faults = _faults(LedDim(factor=0.5), LedDim(leds=(4,), factor=0.4), LedOff(leds=(7,)))
    assert faults.led_factors(0.0) == pytest.approx([0.5, 0.5, 0.5, 0.5, 0.2, 0.5, 0.5, 0.0])


def test_camera_faults_add_up_and_dirt_leaves_the_product_of_what_each_layer_leaves() -> None:
    fault = _faults(
        HotPixels(count=5), HotPixels(count=7), DirtyWindow(cover=0.5), DirtyWindow(cover=0.2), StuckFrame()
    ).camera(0.0)
    assert (fault.hot_pixels, fault.stuck, fault.dropped) == (12, True, False)
    assert fault.dirt_cover == pytest.approx(0.6)


def test_of_two_stuck_exposures_the_one_that_began_last_holds() -> None:
    late, early = ExposureStuck(exposure_s=1e-5, start_s=2.0, stop_s=4.0), ExposureStuck(exposure_s=9e-5, start_s=1.0)
    for order in ((late, early), (early, late)):
        faults = _faults(*order)
        assert [faults.camera(t).exposure_s for t in (0.5, 1.5, 3.0, 4.5)] == [None, 9e-5, 1e-5, 9e-5]


def test_of_two_exposures_that_are_stuck_from_the_same_moment_on_the_later_in_the_list_holds() -> None:
    one, other = ExposureStuck(exposure_s=1e-5, start_s=1.0), ExposureStuck(exposure_s=9e-5, start_s=1.0)
    assert _faults(one, other).camera(1.0).exposure_s == 9e-5
    assert _faults(other, one).camera(1.0).exposure_s == 1e-5


def test_the_stuck_exposures_to_come_are_known_from_the_start() -> None:
    faults = _faults(ExposureStuck(exposure_s=9e-5, start_s=70.0), StuckFrame(), ExposureStuck(exposure_s=1e-5))
    assert faults.exposures_s == {0: 9e-5, 2: 1e-5}  # by their places in the list, by which a refusal names them


def test_gyro_biases_add_and_the_smallest_range_holds() -> None:
    fault = _faults(
        GyroBiasStep(rate_rad_s=(0.1, 0.0, 0.0)),
        GyroBiasStep(rate_rad_s=(0.1, 0.0, -0.3)),
        GyroSaturation(limit_rad_s=0.4),
        GyroSaturation(limit_rad_s=0.2),
        GyroSaturation(limit_rad_s=0.1, start_s=9.0),
    ).imu(1.0)
    assert fault.bias_rad_s == pytest.approx([0.2, 0.0, -0.3])
    assert fault.range_rad_s == 0.2


def test_most_hot_pixels_at_any_time_are_those_of_all_faults_that_overlap() -> None:
    """7 and 5 together from 2 s to 4 s; the 9 that come later, and the 4 that begin as the 9 end, do not add up."""
    apart = HotPixels(count=9, start_s=6.0, stop_s=8.0), HotPixels(count=4, start_s=8.0)
    overlapping = HotPixels(count=7, stop_s=4.0), HotPixels(count=5, start_s=2.0, stop_s=6.0)
    assert _faults(*apart).most_hot_pixels == (0, 9)
    assert _faults(*apart, StuckFrame(), *overlapping).most_hot_pixels == (4, 12)
    assert _faults(StuckFrame()).most_hot_pixels == (-1, 0)


# Hot pixels


def test_hot_pixels_follow_the_published_sequence_of_splitmix64() -> None:
    """Its first five numbers from 1234567 [Rosetta Code, Pseudo-random numbers/Splitmix64], of 2^32 pixels."""
    published = [
        6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821
    ]  # fmt: skip
    expected = [divmod(number % 2**32, 2**16) for number in published]
    assert hot_pixel_places(1234567, 5, 2**16, 2**16).tolist() == [list(place) for place in expected]


def test_hot_pixels_are_different_places_on_the_sensor() -> None:
    for count in (0, 1, 1000):
        places = hot_pixel_places(7, count, 1088, 2048)
        assert places.shape == (count, 2) and len(np.unique(places, axis=0)) == count
        assert (places >= 0).all() and (places < [1088, 2048]).all()


def test_more_hot_pixels_contain_the_fewer_in_the_same_order() -> None:
    many = hot_pixel_places(7, 3000, 60, 80)
    for count in (1, 65, 500, 2999):
        assert np.array_equal(hot_pixel_places(7, count, 60, 80), many[:count])


def test_all_pixels_can_be_hot() -> None:
    assert len(np.unique(hot_pixel_places(3, 30 * 40, 30, 40), axis=0)) == 1200


def test_another_key_has_other_hot_pixels() -> None:
    a, b = (set(map(tuple, hot_pixel_places(key, 200, 1088, 2048).tolist())) for key in (1, 2))
    assert len(a & b) < 5  # expected 0.02


def test_hot_pixels_lie_evenly_over_the_sensor() -> None:
    """Chi-square of 64 fields, 63 degrees of freedom: above 122 once in 1e5."""
    places = hot_pixel_places(2**64 - 1, 20000, 1088, 2048)
    counts = np.histogram2d(*places.T, bins=8, range=[[0, 1088], [0, 2048]])[0]
    expected = 20000 / 64
    assert ((counts - expected) ** 2).sum() / expected < 122.0


# Refusals


@pytest.mark.parametrize(
    ("fault", "key"),
    [
        (LedOff(start_s=2.0, stop_s=2.0), "stop_s"),
        (LedOff(start_s=math.nan), "start_s"),
        (StuckFrame(stop_s=math.nan), "stop_s"),
        (LedOff(leds=(8,)), "leds"),
        (LedOff(leds=(-1,)), "leds"),
        (LedOff(leds=()), "leds"),
        (LedOff(leds=(1, 1)), "leds"),
        (LedDim(factor=1.1), "factor"),
        (LedDim(factor=-0.1), "factor"),
        (LedFlicker(frequency_hz=0.0, duty=0.5), "frequency_hz"),
        (LedFlicker(frequency_hz=math.inf, duty=0.5), "frequency_hz"),
        (LedFlicker(frequency_hz=1.0, duty=1.5), "duty"),
        (LedFlicker(frequency_hz=1.0, duty=0.5, depth=2.0), "depth"),
        (HotPixels(count=-1), "count"),
        (HotPixels(count=1.5), "count"),  # type: ignore[arg-type]
        (DirtyWindow(cover=1.01), "cover"),
        (ExposureStuck(exposure_s=0.0), "exposure_s"),
        (GyroSaturation(limit_rad_s=-1.0), "limit_rad_s"),
        (GyroBiasStep(rate_rad_s=(0.0, math.inf, 0.0)), "rate_rad_s"),
        (GyroBiasStep(rate_rad_s=(0.0, 1.0)), "rate_rad_s"),  # type: ignore[arg-type]
    ],
)
def test_a_number_that_makes_no_sense_is_refused_with_its_place(fault: Fault, key: str) -> None:
    with pytest.raises(DockairError) as refusal:
        _faults(LedOff(), fault)
    assert refusal.value.where == f"faults[1].{key}"
    assert refusal.value.expected


def test_more_hot_pixels_than_pixels_are_refused() -> None:
    with pytest.raises(DockairError, match=r"hot_pixels\.count"):
        hot_pixel_places(1, 101, 10, 10)
