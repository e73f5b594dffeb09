"""The chain on pixels alone, without any idea of the drogue's roll: a coded ring says it."""

import numpy as np
import pytest

from dockair.rotations import log, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.ground.fig29 import PixelChain
from dockair.scenarios.studio import studio

UNEVEN = "angles_deg = [0, 45, 90, 135, 180, 225, 270, 327]\n"
BRIGHT = "brightness = [4, 1, 1, 1, 1, 1, 1, 1]\n"


@pytest.mark.slow
@pytest.mark.parametrize("code", [UNEVEN, BRIGHT, ""], ids=["displaced", "bright", "even"])
def test_a_rolled_drogues_attitude_is_solved_from_a_coded_ring_and_from_no_other(tmp_path, code):
    """Rendered as built at 6 and 10 m, the brightness of an LED anywhere in its bin of 2:1."""
    sheet = tmp_path / "ring.toml"
    sheet.write_text(f"diameter_m = 0.5\ncount = 8\n{code}", encoding="utf-8")
    with studio({"camera.background": "analytic", "hardware.ring": str(sheet)}) as place:
        for ahead_m, roll_deg in ((6.0, 120.0), (10.0, -75.0)):
            R_CD = matrix_from_yaw_pitch_roll(0.1, -0.15, np.radians(roll_deg))
            taken = place.take(place.seen_at(R_CD, np.array([ahead_m, 0.3, 0.2])))
            pose = PixelChain(place.parts.sheets, roll_rad=None).step(taken.frame)
            if code:
                assert np.degrees(np.linalg.norm(log(pose.R_CD.T @ R_CD))) < 3.0
                np.testing.assert_allclose(pose.p_CD, taken.p_CD, atol=0.05)
            else:
                assert pose is None
