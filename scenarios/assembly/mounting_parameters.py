"""Where probe, camera and IMU sit on a receiver, as its sheet says."""

from dataclasses import dataclass

from dockair.calibration import Mounting
from dockair.rotations import Array, matrix_from_yaw_pitch_roll


@dataclass(frozen=True, slots=True, kw_only=True)
class MountingParameters:
    """Sheet `mounting`."""

    probe_tip_m: Array
    camera_position_m: Array
    camera_yaw_rad: float
    imu_position_m: Array

    def mounting(self) -> Mounting:
        """Return the nominal mounting; the camera's axis lies in the body's x-y plane."""
        R_BC = matrix_from_yaw_pitch_roll(self.camera_yaw_rad, 0.0, 0.0)
        return Mounting(R_BC=R_BC, p_BC=self.camera_position_m, p_BP=self.probe_tip_m, p_BI=self.imu_position_m)
