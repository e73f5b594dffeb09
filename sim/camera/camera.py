"""The near-infrared camera: one exposure of the world, from radiance to the message that leaves the camera.

In this order: the scene behind (`background`), the veil and the Sun's disc (`glare`), LEDs and glints as point sources
(`radiometry`, `optics`), electronics (`electronics`). The image of an LED is hidden when something lies between it and
the lens; then it is absent, as are LEDs outside the picture. The world stands still during an exposure.

Time: `expose` is called with the world at the middle of the exposure; the frame arrives `latency_s` later.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import CameraFrame, Window
from dockair.rotations import Array
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.background import Background
from dockair.sim.camera.electronics import digitise, latency_s, output_gain
from dockair.sim.camera.glare import add_disc, find_glints, is_clear, rim_of, veil_electrons
from dockair.sim.camera.optics import add_blobs, psf_sigmas_px
from dockair.sim.camera.radiometry import (
    CameraParameters,
    LedParameters,
    LightParameters,
    led_electrons,
    responses,
)

__all__ = ["CameraParameters", "LedParameters", "LightParameters", "NearInfraredCamera"]

_FAINTEST_E = 0.5  # a whole blob with fewer electrons is left out
_LED_AXIS_D = np.array([-1.0, 0.0, 0.0])  # [docs/notation.md]: LEDs shine aft


class NearInfraredCamera:
    """A camera as built, on the receiver. It reads the world and changes nothing in it."""

    def __init__(
        self,
        parameters: CameraParameters,
        leds: LedParameters,
        light: LightParameters,
        as_built: AsBuilt,
        image_key: int,
        model: mujoco.MjModel,
        sun_direction_W: Array | None,
    ) -> None:
        """Prepare; OpenGL starts with the first exposure.

        Args:
            parameters: sheet `camera`.
            leds: sheet `leds`.
            light: sheet `light`.
            as_built: the hardware.
            image_key: of `dockair.streams.counter_key`.
            model: the world's, with bodies "receiver" and "drogue".
            sun_direction_W: (3,) unit vector toward the Sun; None for no disc, veil or glints.
        """
        self._parameters, self._leds, self._light = parameters, leds, light
        self._as_built, self._key, self._model = as_built, image_key, model
        self._sun_W = None if sun_direction_W is None else np.array(sun_direction_W, dtype=float)
        self._receiver, self._drogue = model.body("receiver").id, model.body("drogue").id
        self._rim = rim_of(model)
        self._response = responses(parameters, leds, light, as_built.camera)
        self._background = Background(model, as_built.camera, parameters.background_reduction)

    def expose(self, data: mujoco.MjData, time_s: float, frame_number: int, window: Window | None) -> CameraFrame:
        """Return the frame of the world as it stands.

        Args:
            data: positions up to date (mj_kinematics or mj_forward); only read.
            time_s: middle of the exposure.
            frame_number: which of the noise's frames this is.
            window: what to read; None for the full frame.

        Raises:
            DockairError: the window is not inside the sensor.
            MachineError: no off-screen OpenGL here.
        """
        window = self._checked(window)
        pixels = digitise(
            self.expected_electrons(data, window),
            self._parameters,
            self._key,
            frame_number,
            (window.row_start, window.column_start),
        )
        pixels.setflags(write=False)
        return CameraFrame(
            time_stamp_s=time_s,
            pixels=pixels.astype(np.uint8, copy=False),
            window=window,
            exposure_s=self._parameters.exposure_s,
            gain=output_gain(self._parameters),
        )

    def latency_s(self, frame: CameraFrame) -> float:
        """Time [s] from the frame's stamp until it has arrived."""
        return latency_s(frame.window, self._parameters)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._background.close()

    def expected_electrons(self, data: mujoco.MjData, window: Window) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of the window, before any noise or clipping."""
        pose = self.pose(data)
        sun_C = None if self._sun_W is None else pose[0].T @ self._sun_W
        floor, visible, first = 0.0, np.zeros((0, 0), dtype=np.bool_), (0, 0)
        if sun_C is not None and sun_C[0] > 0.0:
            visible, first, fraction = self._sun_visibility(data, pose, sun_C)
            floor = veil_electrons(self._parameters, self._as_built.camera, sun_C, self._response.sun_flux_e, fraction)
        image = self._background.electrons(data, pose, window, self._response.white_e, floor)
        start = window.row_start, window.column_start
        if visible.any() and sun_C is not None:
            self._add_sun(image, start, sun_C, visible, first)
        for p_C, electrons, size_m in self._point_sources(data, pose):
            self._add_points(image, start, p_C, electrons, size_m)
        return image

    def pose(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Return R_WC (3, 3) and p_WC (3,) of the camera as built [m]."""
        R_WB = data.xmat[self._receiver].reshape(3, 3)
        mounting = self._as_built.mounting
        return R_WB @ mounting.R_BC, data.xpos[self._receiver] + R_WB @ mounting.p_BC

    def visible_leds(self, data: mujoco.MjData) -> NDArray[np.bool_]:
        """(n,) which LEDs nothing hides from the lens: truth, for logs and tests. Outside the picture counts too."""
        _, p_WC = self.pose(data)
        return self._clear(data, p_WC, self._leds_W(data))

    def _leds_W(self, data: mujoco.MjData) -> Array:
        R_WD = data.xmat[self._drogue].reshape(3, 3)
        return np.asarray(data.xpos[self._drogue] + self._as_built.ring_positions_D @ R_WD.T)

    def _clear(self, data: mujoco.MjData, p_WC: Array, leds_W: Array) -> NDArray[np.bool_]:
        rays = leds_W - p_WC
        distances = np.linalg.norm(rays, axis=1)
        clearance = self._leds.occlusion_clearance_m
        return np.array(
            [
                is_clear(self._model, data, p_WC, ray / distance, distance - clearance)
                for ray, distance in zip(rays, distances, strict=True)
            ]
        )

    def _point_sources(self, data: mujoco.MjData, pose: tuple[Array, Array]) -> list[tuple[Array, Array, float]]:
        """LEDs, then glints: positions (n, 3) in C, electrons (n,), size [m]."""
        R_WC, p_WC = pose
        leds_W = self._leds_W(data)
        axis_C = R_WC.T @ data.xmat[self._drogue].reshape(3, 3) @ _LED_AXIS_D
        p_CL = (leds_W - p_WC) @ R_WC
        electrons = led_electrons(self._response, self._leds, self._as_built.led_intensity_w_sr, p_CL, axis_C)
        sources: list[tuple[Array, Array, float]] = [
            (p_CL, np.where(self._clear(data, p_WC, leds_W), electrons, 0.0), self._leds.die_size_m)
        ]
        if self._sun_W is not None:
            glints = find_glints(self._model, data, self._rim, p_WC, self._sun_W, self._light)
            p_C = (glints.p_W - p_WC) @ R_WC
            r = np.linalg.norm(p_C, axis=1)
            cos_t = np.clip(p_C[:, 0] / r, 0.0, 1.0)
            sources.append((p_C, self._response.glint_e * 0.25 * glints.r1_r2_m2 * cos_t / r**2, 0.0))
        return sources

    def _add_points(
        self, image: NDArray[np.float32], start: tuple[int, int], p_C: Array, electrons: Array, size_m: float
    ) -> None:
        camera = self._as_built.camera
        kept = (p_C[:, 0] > 0.0) & (electrons > _FAINTEST_E)
        if not kept.any():
            return
        p_C = p_C[kept]
        sigmas = psf_sigmas_px(self._parameters, camera, self._leds.wavelength_m, p_C[:, 0], size_m)
        add_blobs(image, start, camera.pixels_from_points(p_C), electrons[kept], sigmas)

    def _sun_visibility(
        self, data: mujoco.MjData, pose: tuple[Array, Array], sun_C: Array
    ) -> tuple[NDArray[np.bool_], tuple[int, int], float]:
        """Which blocks around the Sun's image see it, the first block's indices, and the visible part of the disc."""
        camera, k = self._as_built.camera, self._parameters.background_reduction
        (u, v) = camera.pixels_from_points(sun_C[None])[0]
        radius = camera.focal_length_px * np.tan(self._light.sun_angular_radius_rad)
        reach = radius + 6.0 * self._sun_blur_px()
        first = int((v - reach) // k), int((u - reach) // k)
        count = int(2.0 * reach // k) + 2
        centres = k * (np.arange(count) + 0.5) - 0.5
        grid_u, grid_v = np.meshgrid(k * first[1] + centres, k * first[0] + centres)
        rays = camera.rays_from_pixels(np.column_stack([grid_u.ravel(), grid_v.ravel()])) @ pose[0].T
        visible = np.array([is_clear(self._model, data, pose[1], ray, np.inf) for ray in rays]).reshape(count, count)
        disc = np.hypot(grid_u - u, grid_v - v) <= radius
        return visible, first, float(visible[disc].mean())

    def _sun_blur_px(self) -> float:
        """Standard deviation of the PSF's core for the Sun's edge."""
        sigmas = psf_sigmas_px(
            self._parameters, self._as_built.camera, self._leds.wavelength_m, np.array([np.inf]), 0.0
        )
        return float(sigmas[0, 0])

    def _add_sun(
        self,
        image: NDArray[np.float32],
        start: tuple[int, int],
        sun_C: Array,
        visible: NDArray[np.bool_],
        first: tuple[int, int],
    ) -> None:
        camera = self._as_built.camera
        u, v = camera.pixels_from_points(sun_C[None])[0]
        radius = camera.focal_length_px * float(np.tan(self._light.sun_angular_radius_rad))
        electrons = self._response.sun_disc_e * sun_C[0] ** 4
        k = self._parameters.background_reduction
        add_disc(image, start, (u, v), radius, self._sun_blur_px(), electrons, visible, first, k)

    def _checked(self, window: Window | None) -> Window:
        full = self._as_built.camera.full_window
        if window is None:
            return full
        inside = (
            0 <= window.row_start < window.row_stop <= full.row_stop
            and 0 <= window.column_start < window.column_stop <= full.column_stop
        )
        if not inside:
            raise DockairError("camera.window", expected=f"a window inside {full}", got=window)
        return window
