"""What may be claimed for contact, as frames come in and out of order."""

from types import SimpleNamespace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.contact_watch import ContactWatch
from dockair.nav.integrity.coasting import CoastingSettings
from dockair.nav.integrity.contact import ContactLimits
from dockair.nav.integrity.monitor import check_integrity
from dockair.nav.pose.estimate import solve_pose

RING, CAMERA = LedRing().positions_D, Camera()
PLACE_M = np.array([2.0, 0.1, -0.05])


class Stands:
    """A belief that says the same at all times."""

    doubted_s = -np.inf

    def predicted_pose(self, time_s):
        return np.eye(3), PLACE_M, np.eye(6) * 1e-8

    def felt(self, from_s, to_s):
        return False


@pytest.mark.parametrize("by", [None, "late pose", "few LEDs"])
def test_a_struck_drogue_has_gone_since_the_last_frame_that_was_used_whatever_it_had(by):
    """Eq. (1): d (1 + age / t), with t = 0.02 s where the frame in between was used, else 0.04 s."""
    sheets = SimpleNamespace(
        mounting=SimpleNamespace(R_BC=np.eye(3)), ring=SimpleNamespace(diameter_m=0.5), camera_rate_hz=50
    )
    watch = ContactWatch(sheets, Stands(), ContactLimits(), CoastingSettings())
    pixels = CAMERA.pixels_from_points(RING + PLACE_M)
    there = check_integrity(solve_pose(pixels, RING, CAMERA, sigma_px=0.02))
    gone_m = np.array([0.0, 5e-4, 0.0])
    gone = check_integrity(solve_pose(CAMERA.pixels_from_points(RING + PLACE_M + gone_m), RING, CAMERA, sigma_px=0.02))
    watch._coasting = SimpleNamespace(
        due=lambda time_s: False, added=lambda levels, age_s, sigmas_m: levels, is_of=lambda time_s: True
    )
    watch.used(there, RING, 1.00)
    if by == "few LEDs":
        watch.corrected(1.02)
    watch.refused(gone, RING, 1.04)
    if by == "late pose":
        watch.used(there, RING, 1.02)
    level_m = [watch.claim(time_s).levels.lateral_m for time_s in (1.04, 1.08)]
    assert level_m[1] - level_m[0] == pytest.approx(gone_m[1] * (0.04 / (0.02 if by else 0.04)), rel=0.02)


@pytest.mark.parametrize(
    ("camera_hz", "age_s", "asked"),
    [(50, 0.3, True), (50, 0.4, True), (50, 0.41, False), (50, np.nan, False), (4, 0.55, True), (4, 0.7, False)],
)
def test_a_belief_is_not_asked_over_a_drop_out_that_ended_its_claim(camera_hz, age_s, asked):
    """It has just found the drogue again: what it foretold then says nothing of it; of a slow camera it is usual."""
    sheets = SimpleNamespace(
        mounting=SimpleNamespace(R_BC=np.eye(3)), ring=SimpleNamespace(diameter_m=0.5), camera_rate_hz=camera_hz
    )
    belief = Stands()
    belief.p_PD_B = lambda time_s: PLACE_M
    belief.foretold_p_PD_B = lambda time_s, horizon_s: (PLACE_M, age_s)
    watch = ContactWatch(sheets, belief, ContactLimits(), CoastingSettings())
    watch.used(check_integrity(solve_pose(CAMERA.pixels_from_points(RING + PLACE_M), RING, CAMERA)), RING, 1.0)
    assert watch._coasting.is_of(1.0) == asked
