"""Dock with a navigator of one's own: any class with `step(imu, frame) -> NavSolution`, named in a scenario.

    python examples/own_navigator.py [SCENARIO] [SEED]

Step by step: docs/tutorials/own_navigator.md, which has the same lines. The navigator has no covariance to speak of and
no gates: it shows where one plugs in, not how to fly well. It asks for measured LEDs in place of frames, so that it
need not find them.
"""

import sys

import numpy as np

from dockair.messages import NavSolution
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.rotations import exp

PLACE_GAIN, VELOCITY_GAIN_1_S = 0.5, 6.0  # of what a frame says that was not expected
TRUSTED_S = 0.5  # since the last frame that was used: after that nothing is flown on
SIGMA = np.repeat([0.02, 0.01, 0.1], 3)  # rad, m, m/s: claimed, whatever the range


class MyNavigator:
    """A pose from each frame, smoothed by two fixed gains, and Dockair's own guidance."""

    def __init__(self, sheets):
        self.sheets, self.dt = sheets, 1.0 / sheets.control_rate_hz
        self.guidance = Guidance(GuidanceSettings(), sheets.control_rate_hz)
        self.p, self.v, self.R_BD = sheets.start.p_PD_B.copy(), np.zeros(3), sheets.start.R_BD
        self.time_s, self.used_s, self.status = 0.0, float("nan"), "no frame yet"

    def step(self, imu, frame):
        """Take what arrived since the last control tick."""
        self.time_s += self.dt
        w = self.sheets.mounting.R_BI @ imu[-1].angular_rate_rad_s if imu else np.zeros(3)
        turn = exp(-self.dt * w)  # the body turns, the drogue does not
        self.p, self.v, self.R_BD = turn @ (self.p + self.dt * self.v), turn @ self.v, turn @ self.R_BD
        if frame is not None:
            self.status = self._take(frame)
        valid = self.time_s - self.used_s < TRUSTED_S  # false before the first frame
        coupling = self.p + self.sheets.coupling_depth_m * self.R_BD[:, 0]
        command = self.guidance.step(RelativeState(
            usable=valid, contact_usable=valid, p_PD_B=self.p, rate_PD_B=self.v - np.cross(w, self.p), p_PK_B=coupling,
            w_WB_B=w, sigma_lateral_m=SIGMA[3],
        ))  # fmt: skip
        return NavSolution(
            time_stamp_s=self.time_s, valid=valid, status=self.status, frame_time_stamp_s=self.used_s,
            phase=self.guidance.phase.value, phase_reason=self.guidance.phase_reason, command=command,
            p_PD_B=self.p, v_PD_B=self.v, R_BD=self.R_BD,
            covariance=np.diag(SIGMA**2) if valid else np.full((9, 9), np.nan),
            window=None, candidates_px=np.empty((0, 2)), led_pixels_px=np.full((8, 2), np.nan),
        )  # fmt: skip

    def signal(self, signal):
        """Take what the pod's light begins to show: a hold goes by it."""
        self.guidance.signal(signal)

    def _take(self, seen):
        m, ring_D = self.sheets.mounting, self.sheets.ring.positions_D[seen.led_numbers]
        expected = m.R_BC.T @ self.R_BD, m.R_BC.T @ (self.p + m.p_BP - m.p_BC)
        pose = solve_pose(seen.centroids_px, ring_D, self.sheets.camera, sigma_px=seen.sigma_px, initial=expected)
        if pose.status is not PoseStatus.CONVERGED:
            return f"pose {pose.status.value}"
        before = self.p - (self.time_s - seen.time_stamp_s) * self.v  # a frame is some milliseconds old when it arrives
        unexpected = m.R_BC @ pose.p_CD + m.p_BC - m.p_BP - before
        first = np.isnan(self.used_s)  # whose place is taken whole
        place, velocity_1_s = (1.0, 0.0) if first else (PLACE_GAIN, VELOCITY_GAIN_1_S)
        self.p, self.v = self.p + place * unexpected, self.v + velocity_1_s * unexpected
        self.R_BD, self.used_s = m.R_BC @ pose.R_CD, seen.time_stamp_s
        return "pose used"


def main(scenario_name: str = "default", seed: str = "0") -> None:
    """Fly a scenario with this navigator and say how it ended."""
    from dockair.scenarios.loop import fly  # what flies it; the navigator itself has no use for a simulator
    from dockair.scenarios.schema import load_scenario

    keys = {"navigation.navigator": "own_navigator:MyNavigator", "camera.sensing": "measurements"}
    result = fly(load_scenario(scenario_name, keys), int(seed))
    over_s = result.duration_s if result.contact is None else result.contact.time_s  # hold and retreat follow
    print(f"{result.outcome} after {over_s:.1f} s")
    if result.contact is not None:
        print(f"  {result.contact.radial_offset_m:.3f} m off centre at {result.contact.closure_speed_m_s:.2f} m/s")


if __name__ == "__main__":
    main(*sys.argv[1:])
