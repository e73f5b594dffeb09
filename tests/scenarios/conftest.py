"""A flight made by hand: no world, no sensors' errors, no navigation; for tests of what is done with a flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.messages import CameraFrame, ImuSample, NavSolution, ReceiverCommand, Window
from dockair.rotations import Array, exp, matrix_from_yaw_pitch_roll
from dockair.sim.truth import Truth

LINKS = 16


def _sheets() -> NavigationSheets:
    return NavigationSheets(
        camera=Camera(),
        ring=LedRing(),
        mounting=Mounting(
            R_BC=matrix_from_yaw_pitch_roll(0.02, 0.0, 0.0),
            p_BC=np.array([4.3, 0.0, 1.2]),
            p_BP=np.array([6.8, 0.4, 1.0]),
        ),
        start=StartGeometry(
            p_PD_B=np.array([4.0, 0.0, 0.0]),
            sigma_p_m=np.array([0.3, 0.3, 0.3]),
            R_BD=np.eye(3),
            sigma_R_rad=np.full(3, 0.08),
        ),
        gyro=GyroSheet(rate_hz=500, noise_density_rad_s_rthz=1.7e-4, bias_sigma_rad_s=4.8e-5),
        camera_rate_hz=50,
        control_rate_hz=100,
        coupling_depth_m=0.25,
    )


@dataclass
class HandMadeFlight:
    """Closes from 4 m at 1.2 m/s after 3 s, is held for 2 s and backs off; the estimates are 5 mm and 2 mm wrong."""

    sheets: NavigationSheets = field(default_factory=_sheets)
    sigma_m: float = 0.01
    error_B: Array = field(default_factory=lambda: np.array([0.005, 0.002, 0.0]))

    def ahead_m(self, t: float) -> float:
        """Ring centre ahead of the tip."""
        closed = 4.0 - 1.2 * max(t - 3.0, 0.0)
        return max(closed, -0.25) if t < 8.5 else min(-0.25 + 1.0 * (t - 8.5), 3.5)

    def phase(self, t: float) -> str:
        """Phase at a time."""
        names = ["pre_contact", "approach", "contact", "hold", "disconnect", "clear"]
        return names[int(np.searchsorted([3.0, 6.55, 7.0, 8.5, 11.5], t, side="right"))]

    def truth(self, tick: int) -> Truth:
        """Truth at a physics tick of 1 ms."""
        t = tick / 1000.0
        zero = np.zeros(3)
        take_in = float(np.interp(t, [6.6, 7.6, 8.5, 9.5], [0.0, 1.2, 1.2, 0.0]))
        p_WD = np.array([-14.5 + take_in, 0.1 * np.sin(1.5 * t), -2.8 + 0.06 * np.cos(1.1 * t)])
        R_WD = matrix_from_yaw_pitch_roll(0.02 * np.sin(t), -0.16, 0.0)
        R_WB = matrix_from_yaw_pitch_roll(0.0, -0.05, 0.03 * np.sin(0.8 * t))
        p_WP = p_WD - R_WB @ np.array([self.ahead_m(t), 0.03 * np.sin(2 * t), 0.02])
        s = np.linspace(0.0, 1.0, LINKS + 1)[:, None]
        latched = 6.55 <= t < 8.5
        return Truth(
            tick=tick, time_s=t, R_WB=R_WB, p_WB=p_WP - R_WB @ self.sheets.mounting.p_BP, v_WB=zero, w_WB_B=zero,
            alpha_WB_B=zero, a_WB=zero, specific_force_B=R_WB.T @ np.array([0.0, 0.0, 9.80665]),
            p_WP=p_WP, v_WP=np.array([1.2, 0.0, 0.0]), R_WD=R_WD, p_WD=p_WD, v_WD=zero, w_WD_D=zero,
            p_WH=p_WD * s - np.array([0.0, 0.0, 0.5]) * s * (1 - s), R_WT=np.eye(3), p_WT=np.array([4.0, 0.0, 1.5]),
            reel_position_m=take_in, reel_rate_m_s=0.0, root_tension_n=1500.0, drogue_tension_n=1300.0,
            gust_B_m_s=zero, gust_D_m_s=zero, airspeed_m_s=180.0, angle_of_attack_rad=0.05, sideslip_rad=0.0,
            throttle=0.4, latched=latched, coupling_force_n=700.0 * latched, probe_touches_drogue=latched,
            receiver_touches="",
        )  # fmt: skip

    def p_CD(self, truth: Truth) -> Array:
        """Drogue in camera axes."""
        mounting = self.sheets.mounting
        return mounting.R_BC.T @ (truth.p_PD_B + mounting.p_BP - mounting.p_BC)

    def leds_px(self, truth: Truth) -> Array:
        """Where the LEDs are imaged."""
        R_CD = self.sheets.mounting.R_BC.T @ truth.R_WB.T @ truth.R_WD
        return self.sheets.camera.pixels_from_points(self.sheets.ring.positions_D @ R_CD.T + self.p_CD(truth))

    def frame(self, truth: Truth) -> CameraFrame:
        """A window with eight spots on noise."""
        leds = self.leds_px(truth)
        low, high = np.floor(leds.min(axis=0) - 30).astype(int), np.ceil(leds.max(axis=0) + 30).astype(int)
        low, high = np.maximum(low, 0), np.minimum(high, [2048, 1088])
        window = Window(int(low[1]), int(high[1]), int(low[0]), int(high[0]))
        image = np.random.default_rng(truth.tick).normal(4.0, 1.5, window.shape)
        rows, columns = np.mgrid[window.row_start : window.row_stop, window.column_start : window.column_stop]
        for u, v in leds:
            image += 180.0 * np.exp(-0.5 * ((columns - u) ** 2 + (rows - v) ** 2) / 1.5**2)
        pixels = image.clip(0, 255).astype(np.uint8)
        return CameraFrame(time_stamp_s=truth.time_s - 0.001, pixels=pixels, window=window, exposure_s=2e-5, gain=0.019)

    def tick(self, k: int) -> tuple[Truth, tuple[ImuSample, ...], CameraFrame | None, NavSolution]:
        """Control tick k = 1, 2, ... of 10 ms: five gyro samples, a frame at every second one."""
        truth = self.truth(10 * k)
        imu = tuple(
            ImuSample(time_stamp_s=truth.time_s - 0.002 * i, angular_rate_rad_s=np.array([1e-3 * i, 0.0, k / 3e5]))
            for i in reversed(range(5))
        )
        frame = self.frame(truth) if k % 2 == 0 else None
        leds = self.leds_px(truth)
        solution = NavSolution(
            time_stamp_s=truth.time_s,
            valid=True,
            phase=self.phase(truth.time_s),
            status="converged",
            p_PD_B=truth.p_PD_B + self.error_B,
            v_PD_B=truth.R_WB.T @ (truth.v_WD - truth.v_WP),
            R_BD=exp(np.array([0.01, 0.0, 0.0])) @ truth.R_WB.T @ truth.R_WD,
            covariance=np.eye(9) * self.sigma_m**2,
            command=ReceiverCommand(velocity_m_s=np.array([0.1, 0.0, 0.0])),
            window=frame.window if frame else None,
            frame_time_stamp_s=(10 * (k - k % 2) - 1) / 1000.0 if k >= 2 else float("nan"),
            candidates_px=np.vstack([leds, [[400.0, 300.0]]]),
            led_pixels_px=leds,
        )
        return truth, imu, frame, solution

    def ticks(self, count: int) -> Sequence[tuple[Truth, tuple[ImuSample, ...], CameraFrame | None, NavSolution]]:
        """The first control ticks."""
        return [self.tick(k) for k in range(1, count + 1)]


def bare_truth(time_s: float, **values: object) -> Truth:
    """Everything at rest at the world's origin, level; but for what is given."""
    zero = np.zeros(3)
    vectors = ("p_", "v_", "w_", "a_", "alpha_", "specific_force_", "gust")
    state: dict[str, object] = {f.name: zero if f.name.startswith(vectors) else 0.0 for f in fields(Truth)}
    state |= {"R_WB": np.eye(3), "R_WD": np.eye(3), "R_WT": np.eye(3), "p_WH": np.zeros((2, 3))}
    state |= {"tick": round(time_s * 1000), "time_s": time_s}
    state |= {"latched": False, "probe_touches_drogue": False, "receiver_touches": ""}
    return Truth(**(state | values))  # type: ignore[arg-type]


@pytest.fixture
def make_truth() -> Callable[..., Truth]:
    return bare_truth


@pytest.fixture
def hand_made() -> HandMadeFlight:
    return HandMadeFlight()


@pytest.fixture
def make_hand_made() -> Callable[..., HandMadeFlight]:
    return HandMadeFlight
