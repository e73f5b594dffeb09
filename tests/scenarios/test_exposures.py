"""Exposures that the navigation asks for reach the camera, and leave its own control alone."""

import numpy as np
import pytest

from dockair.messages import CameraFrame, Window
from dockair.scenarios.exposures import ExposuresInTurn
from dockair.scenarios.studio import studio

SMALL = Window(500, 532, 900, 964)


class Noting:
    """Stands where the camera stands; what it was asked for."""

    def __init__(self, latency_s=lambda frame: 0.005 + 0.0 * frame.time_stamp_s):
        self.asked, self.latency_s = [], latency_s

    def expose(self, data, time_s, number, window, **how):
        self.asked.append((number, how))
        pixels = np.zeros(SMALL.shape, np.uint8)
        return CameraFrame(time_stamp_s=time_s, pixels=pixels, window=SMALL, exposure_s=20e-6, gain=1.0)


def test_only_what_was_asked_for_is_passed_on():
    camera = Noting()
    exposures = ExposuresInTurn(camera)
    exposures.begin(None, 0.0, 0, SMALL)
    exposures.begin(None, 0.02, 1, SMALL, 500e-6)
    assert camera.asked == [(0, {}), (1, {"exposure_s": 500e-6})]
    assert exposures.delivered(0.004) is None and exposures.delivered(0.005).time_stamp_s == 0.0


def test_an_exposure_of_which_no_frame_comes_delays_nothing_and_delivers_nothing():
    camera = Noting()
    exposures, whole = ExposuresInTurn(camera), camera.expose
    camera.expose = lambda data, time_s, number, window: None if number == 0 else whole(data, time_s, number, window)
    exposures.begin(None, 0.0, 0, SMALL)
    assert exposures.delivered(0.01) is None
    exposures.begin(None, 0.02, 1, SMALL)
    assert exposures.delivered(0.03).time_stamp_s == 0.02


def test_a_late_transfer_delays_no_later_frame_for_good_where_camera_and_control_have_one_rate():
    """The frame of 1.5 s takes three ticks more, and those behind it wait for it; a tick later they are in time."""
    period_s, ages = 1.0 / 128.0, {}  # exact in binary
    exposures = ExposuresInTurn(Noting(lambda frame: (4.5 if frame.time_stamp_s == 1.5 else 1.5) * period_s))
    for tick in range(512):
        exposures.begin(None, tick * period_s, tick, SMALL)
        frame = exposures.delivered(tick * period_s)
        ages[tick * period_s] = None if frame is None else tick - round(frame.time_stamp_s / period_s)
    first = [ages[t] for t in ages if 2.0 * period_s <= t < 1.0]
    late = [ages[1.5 + ticks * period_s] for ticks in (1, 2, 3, 4, 5, 6)]
    assert set(first) == {2}
    assert late == [2, None, None, None, 2, 2]
    assert {ages[t] for t in ages if t > 2.0} == {2}


@pytest.mark.slow
def test_an_exposure_that_was_asked_for_is_taken_within_limits_and_changes_no_other_frame():
    def taken(asked):
        with studio({}, 1) as made:
            data = made.ahead(8.0)
            return [made.camera.expose(data, 0.02 * k, k, SMALL, e) for k, e in enumerate(asked)]

    own = float("nan")
    plain, mixed = taken([own] * 4), taken([own, 500e-6, 1.0, own])
    assert [f.exposure_s for f in mixed[1:3]] == [500e-6, 500e-6]  # the sheet's longest
    assert mixed[1].pixels.mean() > 2.0 * plain[1].pixels.mean()
    np.testing.assert_array_equal(mixed[0].pixels, plain[0].pixels)
    assert mixed[3].exposure_s == plain[1].exposure_s  # the control has seen one frame before it
