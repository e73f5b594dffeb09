"""Perfect navigation: the truth in place of `nav`, to see what vision costs.

The same guidance flies on it. A scenario names it `navigator = "truth"`; every result of such a flight is marked
`truth_navigation: true`, and reports refuse to pool it with others.
"""

from collections.abc import Sequence

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.messages import CameraFrame, ImuSample, NavSolution, PodSignal, TankerAnnouncement
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.rotations import Array
from dockair.sim.truth import Truth
from dockair.vectors import cross


class TruthNavigator:
    """Stands where `nav.navigator.Navigator` stands; the loop sets `truth` before each step."""

    def __init__(self, sheets: NavigationSheets, settings: GuidanceSettings) -> None:
        self._sheets = sheets
        self._guidance = Guidance(settings, sheets.control_rate_hz)
        # of every solution: LEDs and candidates, none of which is seen, and the covariance of what is exact
        self._always = np.full((len(sheets.ring.positions_D), 2), np.nan), np.empty((0, 2)), np.zeros((9, 9))
        for array in self._always:
            array.setflags(write=False)
        self.truth: Truth | None = None
        self._v_WP: Array | None = None  # of the last tick

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self._guidance.announce(announcement)

    def signal(self, signal: PodSignal) -> None:
        """Take note of what the pod's light begins to show."""
        self._guidance.signal(signal)

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | None) -> NavSolution:
        """Return the true relative state and what the guidance commands on it."""
        truth = self.truth
        assert truth is not None, "the loop sets the truth before each step"
        R_WB, w_WB_B, p_PD_B = truth.R_WB, truth.w_WB_B, truth.p_PD_B
        R_BD = R_WB.T @ truth.R_WD
        v_PD_B = (truth.v_WD - truth.v_WP).dot(R_WB)
        rate_PD_B = v_PD_B - cross(w_WB_B, p_PD_B)
        state = RelativeState(
            usable=True,
            contact_usable=True,
            p_PD_B=p_PD_B,
            rate_PD_B=rate_PD_B,
            p_PK_B=p_PD_B + R_BD[:, 0] * self._sheets.coupling_depth_m,
            w_WB_B=w_WB_B,
            dv_WP_B=np.full(3, np.nan) if self._v_WP is None else (truth.v_WP - self._v_WP).dot(R_WB),
            sigma_lateral_m=0.0,
        )
        self._v_WP = truth.v_WP
        command, (led_pixels_px, candidates_px, covariance) = self._guidance.step(state), self._always
        return NavSolution(
            time_stamp_s=truth.time_s,
            valid=True,
            phase=self._guidance.phase.value,
            status="truth",
            p_PD_B=p_PD_B,
            v_PD_B=v_PD_B,
            R_BD=R_BD,
            covariance=covariance,
            command=command,
            window=None,
            frame_time_stamp_s=float("nan"),
            candidates_px=candidates_px,
            led_pixels_px=led_pixels_px,
            phase_reason=self._guidance.phase_reason,
        )
