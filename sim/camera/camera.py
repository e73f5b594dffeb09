"""The near-infrared camera: one exposure of the world, from radiance to the message that leaves the camera.

    sky and scene in haze ► stray light of the Sun ► its disc ► point sources ► expected electrons
    expected electrons ► electronics ► pixels ► exposure control ► exposure of the next frame

Point sources are the LEDs, their reflections and the Sun's, each spread by `optics` and smeared over the exposure by
the motion of what they sit on. An LED is hidden when something lies between it and the lens.

Time: `expose` is called with the world at the middle of the exposure; the frame arrives `latency_s` later.
Not modelled: motion of background and Sun during an exposure.
"""

from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import CameraFrame, Window
from dockair.rotations import Array
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.background import Background
from dockair.sim.camera.blobs import Blobs
from dockair.sim.camera.camera_noise import CameraNoise
from dockair.sim.camera.coarse_grid import CoarseGrid
from dockair.sim.camera.defects import Defects
from dockair.sim.camera.dirt import Dirt
from dockair.sim.camera.electronics import digitise, output_gain
from dockair.sim.camera.exposure import ExposureControl
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.glare import Glare
from dockair.sim.camera.image_point import image_points
from dockair.sim.camera.normals_ahead import NormalsAhead
from dockair.sim.camera.optics import PointSpread
from dockair.sim.camera.point_sources import PointSources
from dockair.sim.camera.radiometry import extinction_1_m, led_wavelength_m, responses_in_flight
from dockair.sim.camera.readout import latency_s, transfer_jitter_s
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.camera.sky import Sky
from dockair.sim.camera.sky_radiance import SkyRadiance
from dockair.sim.camera.sun_view import SunView
from dockair.sim.camera.weather import Weather
from dockair.sim.faults import CameraFault, Faults

__all__ = ["CameraNoise", "NearInfraredCamera"]

_EDGE_SIGMAS = 6.0  # how far the blurred edge of the Sun's disc is drawn


class NearInfraredCamera:
    """A camera as built, on the receiver. It reads the world and changes nothing in it.

    Args:
        sheets: nominal parameters.
        as_built: the hardware.
        noise: of `CameraNoise.of`.
        model: the world's, with bodies "receiver" and "drogue".
        sun_direction_W: (3,) unit vector toward the Sun. None is daylight without the Sun's own image: sky and solids
            are lit from above, but there is no disc, glint or stray light. For no light there is the weather's night.
        weather: clouds, haze, night.
        altitude_m: of the flight.
        airspeed_m_s: of W along its x through the air: clouds and ground below pass by; 0 is for scenes that stand.
        faults: what breaks, and when.
        automatic_exposure: whether the camera sets its exposure itself.
        background: "mujoco", "analytic", or "auto" for the first that this machine has.
    """

    def __init__(
        self,
        sheets: CameraSheets,
        as_built: AsBuilt,
        noise: CameraNoise,
        model: mujoco.MjModel,
        *,
        sun_direction_W: Array | None,
        weather: Weather | None = None,
        altitude_m: float = 6000.0,
        airspeed_m_s: float = 0.0,
        faults: Faults | None = None,
        automatic_exposure: bool = True,
        background: str = "auto",
    ) -> None:
        weather = weather or Weather()
        self._sheets, self._as_built, self._noise = sheets, as_built, noise
        self._faults = faults or Faults((), len(as_built.led_intensity_w_sr))
        self._receiver, self._airspeed_m_s = model.body("receiver").id, airspeed_m_s
        camera = as_built.camera
        self._response = responses_in_flight(sheets, camera, altitude_m, sun_direction_W)
        wavelength = led_wavelength_m(sheets.leds)
        self._spread = PointSpread(sheets.lens, sheets.sensor, camera, wavelength)
        self._blobs = Blobs(camera, self._spread)
        self._sky = Sky(SkyRadiance(sheets.sky, weather, sun_direction_W, altitude_m, noise.clouds))
        self._extinction_1_m = extinction_1_m(weather.visibility_m)
        self._sun: SunView | None = None
        sun_radius_rad = sheets.light.sun_angular_radius_rad
        self._glare = Glare(sheets.glare, sheets.lens, camera, sheets.light, self._response, wavelength)
        if sun_direction_W is not None:
            sun_W = np.array(sun_direction_W, dtype=float)
            margin = _EDGE_SIGMAS * self._spread.edge_sigma_px()
            self._sun = SunView(model, camera, self._sky, sun_W, sun_radius_rad, margin)
        self._background = Background(
            model, camera, sheets.background, self._sky, background, sun_radius_rad=sun_radius_rad
        )
        self._sources = PointSources(model, sheets, as_built, self._response, self._sun, self._extinction_1_m)
        self._defects = Defects(camera, sheets.glare, sheets.exposure, self._faults, noise.dirt, noise.hot_pixels)
        self._pattern = FixedPattern(sheets.sensor, noise.fixed_pattern, camera.height_px, camera.width_px)
        self._normals = NormalsAhead(noise.image, (camera.height_px, camera.width_px))
        self._control = ExposureControl(sheets.exposure, sheets.sensor, automatic=automatic_exposure)
        self._last: CameraFrame | None = None
        self._memory = np.empty(0, dtype=np.float32)  # of each frame's expected electrons: new memory takes its time

    def expose(
        self,
        data: mujoco.MjData,
        time_s: float,
        frame_number: int,
        window: Window | None,
        exposure_s: float = np.nan,
    ) -> CameraFrame | None:
        """Return the frame of the world as it stands; None when the camera has dropped out.

        Args:
            data: positions and velocities up to date (mj_step1 or mj_forward); only read.
            time_s: middle of the exposure.
            frame_number: which of the noise's frames this is.
            window: what to read; None for the full frame.
            exposure_s: asked for, within the sheet's limits, and no business of the exposure control; NaN: its own.

        Raises:
            DockairError: the window is not inside the sensor.
            MachineError: no off-screen OpenGL here, and the background is to be drawn with it.
        """
        window = self._checked(window)
        fault = self._faults.camera(time_s)
        if fault.dropped:
            self.transfer_jitter_s()  # so that later frames take what they took
            return None
        if fault.stuck and self._last is not None:
            return replace(self._last, time_stamp_s=time_s)
        asked = bool(np.isfinite(exposure_s)) and fault.exposure_s is None
        exposure_s = self._control.within_limits(exposure_s) if asked else self.exposure_s(fault)
        start = window.row_start, window.column_start
        expected = self.expected_electrons(data, window, time_s, exposure_s, self._room_for(window))
        pixels = digitise(
            expected, self._sheets.sensor, self._pattern, self._noise.image, frame_number, start, exposure_s,
            ahead=self._normals,
        )  # fmt: skip
        self._defects.whiten(pixels, window, fault.hot_pixels)
        if not asked:
            self._control.step(pixels, exposure_s)
        pixels.setflags(write=False)
        self._last = CameraFrame(
            time_stamp_s=time_s,
            pixels=pixels,
            window=window,
            exposure_s=exposure_s,
            gain=output_gain(self._sheets.sensor),
        )
        return self._last

    @property
    def full_window(self) -> Window:
        """The whole sensor."""
        return self._as_built.camera.full_window

    @property
    def background(self) -> str:
        """Which background is in use: "mujoco" or "analytic"."""
        return self._background.backend

    def exposure_s(self, fault: CameraFault | None = None) -> float:
        """Exposure of the next frame [s]."""
        stuck_at = None if fault is None else fault.exposure_s
        return self._control.exposure_s if stuck_at is None else stuck_at

    def latency_s(self, frame: CameraFrame, jitter_s: float | None = None) -> float:
        """Time [s] from the frame's stamp until it has arrived; its jitter is drawn unless it has been."""
        jitter_s = self.transfer_jitter_s() if jitter_s is None else jitter_s
        return latency_s(frame.window, self._sheets.sensor, frame.exposure_s) + jitter_s

    def least_latency_s(self, window: Window | None) -> float:
        """Time [s], jitter apart, before which the next frame will not arrive, whatever its exposure and faults."""
        if self._faults.any:  # it may be an older one again, of a smaller window
            return latency_s(Window(0, 0, 0, 0), self._sheets.sensor, 0.0)
        return latency_s(window or self.full_window, self._sheets.sensor, self._sheets.exposure.shortest_s)

    def transfer_jitter_s(self) -> float:
        """Draw what the next frame's transfer takes beyond its mean [s]."""
        return transfer_jitter_s(self._sheets.sensor, self._noise.transfer)

    def reset(self) -> None:
        """Forget the frames so far: the exposure is the first one again."""
        self._control.reset()
        self._last = None

    def work_ahead(self) -> bool:
        """Make a little of the numbers and tables that later frames may need, in time that none waits for.

        It says whether anything lacked, and takes a millisecond or two at most. No bit of any frame depends on it.
        """
        return self._normals.work_ahead() or self._spread.work_ahead() or self._background.work_ahead()

    def close(self) -> None:
        """Free the OpenGL context."""
        self._background.close()

    def expected_electrons(
        self,
        data: mujoco.MjData,
        window: Window,
        time_s: float = 0.0,
        exposure_s: float | None = None,
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of the window, before any noise or clipping.

        Args:
            data: as of `expose`.
            window: inside the sensor.
            time_s: middle of the exposure, for faults.
            exposure_s: None for that of the next frame.
            out: (rows, columns) that takes them; a new array by default.
        """
        exposure_s = self.exposure_s() if exposure_s is None else exposure_s
        pose, dirt = self.pose(data), self._defects.dirt(self._faults.camera(time_s).dirt_cover)
        veil = 1.0 if dirt is None else dirt.veil_factor
        sun_C, visible = self._sun_in_view(data, pose)
        if dirt is not None and visible > 0.0:
            visible *= dirt.toward(sun_C)
        stray = self._glare.stray(sun_C, visible, exposure_s, window, veil) if visible > 0.0 else None
        image = self.background_electrons(data, window, exposure_s, stray, dirt, out, pose)
        start = window.row_start, window.column_start
        if self._sun is not None and visible > 0.0:
            self._glare.add_fine(image, start, sun_C, visible, exposure_s, veil)
            patch = self._sun.patch(data, pose)
            if patch is not None:
                seen, first = patch if dirt is None else (patch[0] * dirt.over(patch[0].shape, patch[1]), patch[1])
                self._glare.add_disc(image, start, sun_C, seen, first, exposure_s, self._spread.edge_sigma_px())
        factors = self._faults.led_factors(time_s, exposure_s)
        found = self._sources.candidates(data, pose, exposure_s, factors)
        self._blobs.add(image, start, found, dirt, partial(self._sources.are_seen, data, pose[1], found))
        return image

    def background_electrons(
        self,
        data: mujoco.MjData,
        window: Window,
        exposure_s: float | None = None,
        stray: CoarseGrid | None = None,
        dirt: Dirt | None = None,
        out: NDArray[np.float32] | None = None,
        pose: tuple[Array, Array] | None = None,
    ) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of sky and scene alone, with stray light and dirt if given."""
        exposure_s, pose = self.exposure_s() if exposure_s is None else exposure_s, pose or self.pose(data)
        return self._background.electrons(
            data,
            pose,
            window,
            self._response.white_e_s * exposure_s,
            stray=stray,
            dirt=None if dirt is None else dirt.grid,
            extinction_1_m=self._extinction_1_m,
            place_m=pose[1] + (self._airspeed_m_s * data.time, 0.0, 0.0),
            out=out,
        )

    def _room_for(self, window: Window) -> NDArray[np.float32]:
        rows, columns = window.shape
        if self._memory.size < rows * columns:
            self._memory = np.empty(rows * columns, dtype=np.float32)
        return self._memory[: rows * columns].reshape(rows, columns)

    def _sun_in_view(self, data: mujoco.MjData, pose: tuple[Array, Array]) -> tuple[Array, float]:
        """(3,) unit vector toward the Sun in camera axes, and the part of its disc that the lens sees."""
        if self._sun is None:
            return np.zeros(3), 0.0
        sun_C = pose[0].T @ self._sun.direction_W
        return sun_C, self._sun.visible(data, pose[1]) if sun_C[0] > 0.0 else 0.0

    def pose(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Return R_WC (3, 3) and p_WC (3,) of the camera as built [m]."""
        R_WB = data.xmat[self._receiver].reshape(3, 3)
        mounting = self._as_built.mounting
        return R_WB @ mounting.R_BC, data.xpos[self._receiver] + R_WB @ mounting.p_BC

    def led_pixels(self, data: mujoco.MjData) -> Array:
        """(n, 2) where the lens puts the LEDs on the sensor, hidden or not [px]: truth, for logs and tests."""
        R_WC, p_WC = self.pose(data)
        return image_points(self._as_built.camera, (self._sources.leds_W(data) - p_WC) @ R_WC)

    def visible_leds(self, data: mujoco.MjData) -> NDArray[np.bool_]:
        """(n,) which LEDs nothing hides from the lens: truth, for logs and tests. Outside the picture counts too."""
        return self._sources.visible_leds(data, self.pose(data)[1])

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
