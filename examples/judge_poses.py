"""Judge a pose solver of one's own on a recorded flight, beside Dockair's and beside the truth.

    python examples/judge_poses.py [FOLDER]

FOLDER is that of a flight by camera, `dockair fly`. Where the ring truly was in each frame's camera axes follows from
the truth in flight.parquet and the hardware as it was built. Each frame's blobs are named by that truth, so that only
the poses are compared, each frame by itself. The solver here is OpenCV's; put your own into `own_pose`.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
from scipy.spatial.transform import Rotation

from dockair.calibration import Camera, NavigationSheets
from dockair.messages import CameraFrame
from dockair.nav.image.detect import detect
from dockair.nav.navigator_settings import NavigatorSettings
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.rotations import Array
from dockair.scenarios.message_log import read_messages
from dockair.scenarios.navigator_recipe import NavigatorRecipe

NEAR_PX = 2.0  # a blob so near to where an LED truly is imaged is that LED's
FEWEST = 6  # named LEDs of a frame that is judged
MISPLACED_M = NavigatorSettings().led_position_sigma_m  # an LED about its place on the sheet: near, it is most
RANGES_M = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0)


@dataclass(frozen=True)
class Flown:
    """What a flight's folder says of camera and ring: as the navigation was told, and as they were."""

    sheets: NavigationSheets
    camera: Camera  #: as built
    leds_D: Array  #: (n, 3) as built [m]
    time_s: Array
    R_CD: Array  #: (ticks, 3, 3) the truth
    p_CD: Array  #: (ticks, 3) [m]

    def leds_px(self, k: int) -> Array:
        """(n, 2) where the lens puts the LEDs at a tick [px]."""
        return self.camera.pixels_from_points(self.leds_D @ self.R_CD[k].T + self.p_CD[k])


def read(folder: Path) -> Flown:
    """Read a flight."""
    sheets, built = NavigatorRecipe.read(folder).sheets, json.loads((folder / "as_built.json").read_text("utf-8"))
    table, told, m = pq.read_table(folder / "flight.parquet"), sheets.camera, sheets.mounting
    R_BC = Rotation.from_rotvec(built["camera_turn_B_rad"]).as_matrix() @ m.R_BC
    p_BC, axes, xyzw = m.p_BC + built["camera_shift_B_m"], ("x_m", "y_m", "z_m"), ("x", "y", "z", "w")

    def truth(symbol: str, parts: tuple[str, ...]) -> Array:
        return np.column_stack([table[f"truth_{symbol}_{part}"].to_numpy() for part in parts])

    R_WB, R_WD = (Rotation.from_quat(truth(symbol, xyzw)).as_matrix() for symbol in ("q_WB", "q_WD"))
    distortion = np.add(told.distortion or np.zeros(5), built["distortion_k1_k2_p1_p2_k3"])
    return Flown(
        sheets=sheets,
        camera=Camera(
            focal_length_m=told.focal_length_m + built["focal_length_m"],
            pixel_pitch_m=told.pixel_pitch_m,
            width_px=told.width_px,
            height_px=told.height_px,
            principal_point_px=tuple(np.add(told.principal_point_px, built["principal_point_px"])),
            distortion=tuple(distortion),
        ),
        leds_D=sheets.ring.positions_D + np.column_stack([built[f"led_shift_{axis}_D_m"] for axis in "xyz"]),
        time_s=table["time_s"].to_numpy(),
        R_CD=R_BC.T @ R_WB.transpose(0, 2, 1) @ R_WD,
        p_CD=(m.p_BP + truth("p_PD_B", axes) - p_BC) @ R_BC,
    )


def named(flown: Flown, folder: Path) -> Iterator[tuple[int, Array, Array, Array]]:
    """Yield of each frame its tick, the numbers of the LEDs that were found, their blobs [px] and their sigmas [px]."""
    for tick in read_messages(folder):
        frame = tick.frame
        if not isinstance(frame, CameraFrame):
            continue
        k = int(np.abs(flown.time_s - frame.time_stamp_s).argmin())  # exposures are at control ticks
        blobs = detect(frame.pixels, None, frame.window, gain_dn_per_electron=frame.gain)
        apart = np.linalg.norm(blobs.centroids_px[None] - flown.leds_px(k)[:, None], axis=2)
        found = np.flatnonzero(apart.min(axis=1, initial=np.inf) < NEAR_PX)
        if len(found) >= FEWEST:
            which = apart[found].argmin(axis=1)
            yield k, found, blobs.centroids_px[which], blobs.sigma_px[which]


def own_pose(pixels: Array, leds_D: Array, camera: Camera) -> Array:
    """(3,) p_CD [m] by OpenCV, whose camera axes are right, down, ahead."""
    f, (u, v) = camera.focal_length_px, camera.principal_point_px
    K, bent = np.array([[f, 0.0, u], [0.0, f, v], [0.0, 0.0, 1.0]]), np.array(camera.distortion or np.zeros(5))
    _, _, (right, down, ahead) = cv2.solvePnP(leds_D, pixels, K, bent, flags=cv2.SOLVEPNP_IPPE)
    return np.array([ahead, -right, -down]).ravel()


def main(folder: str = "out/default-0") -> None:
    """Print errors of both, by range."""
    flown = read(Path(folder))
    camera, ring, rows = flown.sheets.camera, flown.sheets.ring, []
    for k, numbers, pixels, sigma_px in named(flown, Path(folder)):
        leds_D, true = ring.positions_D[numbers], flown.p_CD[k]
        misplaced_px = camera.focal_length_px * MISPLACED_M / true[0]
        pose = solve_pose(pixels, leds_D, camera, sigma_px=np.hypot(sigma_px, misplaced_px))
        if pose.status is PoseStatus.CONVERGED:
            rows.append([true[0], *(own_pose(pixels, leds_D, camera) - true), *(pose.p_CD - true)])
    table = np.array(rows)
    print("range m     frames   own: along, across mm   Dockair: along, across mm")
    for low, high in zip(RANGES_M[:-1], RANGES_M[1:], strict=True):
        errors = 1e3 * table[(table[:, 0] >= low) & (table[:, 0] < high), 1:]
        if len(errors):
            rms = np.sqrt((errors**2).mean(axis=0))
            own, ours = (f"{rms[k]:7.1f} {np.hypot(rms[k + 1], rms[k + 2]):6.1f}" for k in (0, 3))
            print(f"{low:.1f} to {high:.1f} {len(errors):7d} {own:>22} {ours:>24}")


if __name__ == "__main__":
    main(*sys.argv[1:])
