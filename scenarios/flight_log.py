"""Everything a flight was, one entry a control tick: truth beside belief, for the figures and for `flight.parquet`.

Column names: `truth_` or `nav_`, the symbol of docs/notation.md, the component, the unit. This file is for people and
their analyses; the exact messages and estimates for a replay are in `message_log`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dockair.messages import CameraFrame, ImuSample, LedObservation, NavSolution
from dockair.rotations import Array, quaternion_from_matrix
from dockair.scenarios.judgement.metrics import true_relative_state
from dockair.sim.truth import Truth

FILE_NAME = "flight.parquet"

#: Field of Truth -> (column, unit), three components x, y, z each.
_TRUTH_VECTORS = {
    "p_WB": ("p_WB", "m"),
    "v_WB": ("v_WB", "m_s"),
    "w_WB_B": ("w_WB_B", "rad_s"),
    "alpha_WB_B": ("alpha_WB_B", "rad_s2"),
    "a_WB": ("a_WB", "m_s2"),
    "specific_force_B": ("specific_force_B", "m_s2"),
    "p_WP": ("p_WP", "m"),
    "v_WP": ("v_WP", "m_s"),
    "p_WD": ("p_WD", "m"),
    "v_WD": ("v_WD", "m_s"),
    "w_WD_D": ("w_WD_D", "rad_s"),
    "p_WT": ("p_WT", "m"),
    "gust_B_m_s": ("gust_B", "m_s"),
    "gust_D_m_s": ("gust_D", "m_s"),
}
_TRUTH_ROTATIONS = ("R_WB", "R_WD", "R_WT")
_TRUTH_SCALARS = (
    "reel_position_m reel_rate_m_s root_tension_n drogue_tension_n airspeed_m_s angle_of_attack_rad sideslip_rad "
    "throttle latched coupling_force_n fuel_kg fuel_flow_kg_s probe_touches_drogue receiver_touches"
).split()


class FlightLog:
    """Collects a flight; what is put in is kept, not copied (messages and truths never change)."""

    def __init__(self) -> None:
        self.truths: list[Truth] = []
        self.solutions: list[NavSolution] = []
        self.imu: list[tuple[ImuSample, ...]] = []
        self.exposures_s: list[float] = []  #: of the frame that arrived, NaN where none did
        self.arrived: list[bool] = []  #: whether a frame or a measurement of its LEDs arrived, used or not

    def append(
        self,
        truth: Truth,
        imu: Sequence[ImuSample],
        frame: CameraFrame | LedObservation | None,
        solution: NavSolution,
    ) -> None:
        """Take one control tick; of the frame, that there was one and how long it was exposed."""
        self.truths.append(truth)
        self.imu.append(tuple(imu))
        self.solutions.append(solution)
        self.exposures_s.append(frame.exposure_s if isinstance(frame, CameraFrame) else float("nan"))
        self.arrived.append(frame is not None)

    @property
    def frames(self) -> int:
        """How many frames have arrived."""
        return sum(self.arrived)

    def frame_numbers(self) -> NDArray[np.int64]:
        """(ticks,) number of the newest frame that has arrived, counted from 0; -1 before the first."""
        return np.cumsum(self.arrived, dtype=np.int64) - 1

    def columns(self) -> dict[str, Any]:
        """Return the columns of `flight.parquet`, (ticks,) each; the hose's joints are lists."""
        if not self.truths:
            return {}
        columns: dict[str, Any] = {
            "tick": np.array([truth.tick for truth in self.truths]),
            "time_s": np.array([truth.time_s for truth in self.truths]),
        }
        return columns | self._truth_columns() | self._nav_columns() | self._sensor_columns()

    def write_parquet(self, out_dir: str | Path) -> Path:
        """Write `flight.parquet` into a folder and return its path."""
        path = Path(out_dir) / FILE_NAME
        with path.open("wb") as file:  # Arrow takes no path but of UTF-8
            pq.write_table(pa.table(self.columns()), file, compression="ZSTD")
        return path

    def _truth_columns(self) -> dict[str, Any]:
        truths = self.truths
        columns: dict[str, Any] = {}
        for field, (symbol, unit) in _TRUTH_VECTORS.items():
            columns |= _components(f"truth_{symbol}", unit, [getattr(truth, field) for truth in truths])
        for field in _TRUTH_ROTATIONS:
            quaternions = [quaternion_from_matrix(getattr(truth, field)) for truth in truths]
            columns |= _components(f"truth_q{field[1:]}", "", quaternions, "wxyz")
        relative = [true_relative_state(truth) for truth in truths]
        columns |= _components("truth_p_PD_B", "m", [p for _, p, _ in relative])
        columns |= _components("truth_v_PD_B", "m_s", [v for _, _, v in relative])
        columns |= {f"truth_{name}": [getattr(truth, name) for truth in truths] for name in _TRUTH_SCALARS}
        columns["truth_p_WH_m"] = [truth.p_WH.ravel() for truth in truths]
        return columns

    def _nav_columns(self) -> dict[str, Any]:
        solutions = self.solutions
        columns: dict[str, Any] = {
            "nav_time_stamp_s": [s.time_stamp_s for s in solutions],
            "nav_valid": [s.valid for s in solutions],
            "nav_contact_usable": [s.contact_usable for s in solutions],
            "nav_phase": [s.phase for s in solutions],
            "nav_phase_reason": [s.phase_reason for s in solutions],
            "nav_status": [s.status for s in solutions],
            "nav_frame_time_stamp_s": [s.frame_time_stamp_s for s in solutions],
            "nav_candidates": [len(s.candidates_px) for s in solutions],
            "nav_leds_named": [int(np.isfinite(s.led_pixels_px[:, 0]).sum()) for s in solutions],
        }
        columns |= _components("nav_p_PD_B", "m", [s.p_PD_B for s in solutions])
        columns |= _components("nav_v_PD_B", "m_s", [s.v_PD_B for s in solutions])
        columns |= _components("nav_q_BD", "", [quaternion_from_matrix(s.R_BD) for s in solutions], "wxyz")
        sigmas = standard_deviations(solutions)
        for symbol, unit, part in (("phi", "rad", 0), ("p_PD_B", "m", 3), ("v_PD_B", "m_s", 6)):
            columns |= _components(f"nav_sigma_{symbol}", unit, sigmas[:, part : part + 3])
        columns["nav_heading_rad"] = [s.heading_rad for s in solutions]
        columns["nav_sigma_heading_rad"] = [s.heading_sigma_rad for s in solutions]
        columns |= _components("command_velocity", "m_s", [s.command.velocity_m_s for s in solutions])
        columns |= _components("command_acceleration", "m_s2", [s.command.acceleration_m_s2 for s in solutions])
        return columns

    def _sensor_columns(self) -> dict[str, Any]:
        none = np.full(3, np.nan)
        rates = [samples[-1].angular_rate_rad_s if samples else none for samples in self.imu]
        forces = [samples[-1].specific_force_m_s2 if samples else none for samples in self.imu]
        columns: dict[str, Any] = {"camera_exposure_s": self.exposures_s}
        columns |= _components("gyro_w_WI_I", "rad_s", rates)
        columns |= _components("accelerometer_f_I", "m_s2", forces)
        return columns


def standard_deviations(solutions: Sequence[NavSolution]) -> Array:
    """(n, 9) standard deviations of (phi, p_PD_B, v_PD_B); NaN where a variance is NaN or negative."""
    variances = np.array([np.diag(s.covariance) for s in solutions]).reshape(-1, 9)
    return np.asarray(np.sqrt(np.where(variances >= 0.0, variances, np.nan)))


def _components(name: str, unit: str, rows: Any, letters: str = "xyz") -> Mapping[str, Array]:
    table = np.asarray(rows, dtype=float)
    tail = f"_{unit}" if unit else ""
    return {f"{name}_{letter}{tail}": table[:, k] for k, letter in enumerate(letters)}
