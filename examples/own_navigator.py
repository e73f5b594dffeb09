"""Dock with a navigator of one's own: any class with `step(imu, frame) -> NavSolution`, named in a scenario.

    python examples/own_navigator.py [SCENARIO] [SEED]

This one solves the pose of every frame by itself, keeps position and velocity with two fixed gains, and steers with the
controller of `own_controller.py`. It has no covariance to speak of, no gates and no breakaway: it shows where the
navigator plugs in, not how to fly. It asks for measured LEDs in place of frames, so that it need not find them.
"""

import sys

import numpy as np
from own_controller import Controller

from dockair.calibration import NavigationSheets
from dockair.messages import ImuSample, LedObservation, NavSolution, ReceiverCommand
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.scenarios.loop import fly
from dockair.scenarios.schema import load_scenario

POSITION_GAIN, VELOCITY_GAIN_1_S = 0.5, 5.0  # of what a frame says that was not expected
SIGMA_M, SIGMA_M_S, SIGMA_RAD = 0.02, 0.1, 0.02  # claimed, whatever the range
CONTACT_M, HELD_S = 0.1, 3.0  # tip in the basket; until the flight is called over


class PlainNavigator:
    """Pose by pose. Body axes turn little in a frame: the gyro is left unused."""

    def __init__(self, sheets: NavigationSheets) -> None:
        """Start where the sheets say the drogue is.

        Args:
            sheets: camera, ring, mounting, start: all that a navigator is given.
        """
        self._sheets, self._dt = sheets, 1.0 / sheets.control_rate_hz
        self._p, self._rate, self._R_BD = sheets.start.p_PD_B.copy(), np.zeros(3), sheets.start.R_BD
        self._controller = Controller(self._dt)
        self._time_s, self._frame_time_s, self._held_s = 0.0, float("nan"), 0.0
        self._status, self._leds_px = "no frame yet", np.full((sheets.ring.count, 2), np.nan)

    def step(self, imu: tuple[ImuSample, ...], frame: LedObservation | None) -> NavSolution:
        """Take what arrived since the last control tick."""
        self._time_s += self._dt
        self._p = self._p + self._dt * self._rate
        if frame is not None:
            self._take(frame)
        velocity, acceleration = self._controller.step(self._p, self._rate)
        touching = self._controller.closing and self._p[0] < CONTACT_M
        self._held_s = self._held_s + self._dt if touching else 0.0
        phase = "approach" if self._controller.closing else "pre_contact"
        if touching:
            phase = "contact" if self._held_s < HELD_S else "clear"
        return NavSolution(
            time_stamp_s=self._time_s,
            valid=bool(np.isfinite(self._frame_time_s)),
            phase=phase,
            status=self._status,
            p_PD_B=self._p,
            v_PD_B=self._rate,
            R_BD=self._R_BD,
            covariance=np.diag(np.repeat([SIGMA_RAD, SIGMA_M, SIGMA_M_S], 3) ** 2),
            command=ReceiverCommand(velocity_m_s=velocity.copy(), acceleration_m_s2=acceleration),
            window=None,
            frame_time_stamp_s=self._frame_time_s,
            candidates_px=np.empty((0, 2)) if frame is None else frame.centroids_px,
            led_pixels_px=self._leds_px,
        )

    def _take(self, seen: LedObservation) -> None:
        mounting = self._sheets.mounting
        self._leds_px = np.full((self._sheets.ring.count, 2), np.nan)
        self._leds_px[seen.led_numbers] = seen.centroids_px
        pose = solve_pose(
            seen.centroids_px, self._sheets.ring.positions_D[seen.led_numbers], self._sheets.camera,
            sigma_px=seen.sigma_px,
            initial=(mounting.R_BC.T @ self._R_BD, mounting.R_BC.T @ (self._p + mounting.p_BP - mounting.p_BC)),
        )  # fmt: skip
        self._status = f"pose {pose.status.value}"
        if pose.status is not PoseStatus.CONVERGED:
            return
        measured = mounting.R_BC @ pose.p_CD + mounting.p_BC - mounting.p_BP
        unexpected = measured - (self._p - (self._time_s - seen.time_stamp_s) * self._rate)
        self._p = self._p + POSITION_GAIN * unexpected
        self._rate = self._rate + VELOCITY_GAIN_1_S * unexpected
        self._R_BD, self._frame_time_s, self._status = mounting.R_BC @ pose.R_CD, seen.time_stamp_s, "pose used"


def main(scenario_name: str = "default", seed: str = "0") -> None:
    """Fly a scenario with this navigator and say how it ended."""
    keys = {"navigation.navigator": "own_navigator:PlainNavigator", "camera.sensing": "measurements"}
    result = fly(load_scenario(scenario_name, keys), int(seed))
    print(f"{result.outcome} after {result.duration_s:.1f} s")
    if result.contact is not None:
        print(f"  {result.contact.radial_offset_m:.3f} m off centre at {result.contact.closure_speed_m_s:.2f} m/s")


if __name__ == "__main__":
    main(*sys.argv[1:])
