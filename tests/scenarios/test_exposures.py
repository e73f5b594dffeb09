"""Exposures that the navigation asks for reach the camera, and leave its own control alone."""

import numpy as np
import pytest

from dockair.messages import CameraFrame, Window
from dockair.scenarios.exposures import ExposuresInTurn
from dockair.scenarios.reproduce.frames import studio

SMALL = Window(500, 532, 900, 964)


class Noting:
    """Stands where the camera stands; what it was asked for."""

    def __init__(self):
        self.asked = []

    def expose(self, data, time_s, number, window, **how):
        self.asked.append((number, how))
        pixels = np.zeros(SMALL.shape, np.uint8)
        return CameraFrame(time_stamp_s=time_s, pixels=pixels, window=SMALL, exposure_s=20e-6, gain=1.0)

    def latency_s(self, frame):
        return 0.005


def test_only_what_was_asked_for_is_passed_on():
    camera = Noting()
    exposures = ExposuresInTurn(camera)
    exposures.begin(None, 0.0, 0, SMALL)
    exposures.begin(None, 0.02, 1, SMALL, 500e-6)
    assert camera.asked == [(0, {}), (1, {"exposure_s": 500e-6})]
    assert exposures.delivered(0.004) is None and exposures.delivered(0.005).time_stamp_s == 0.0


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
