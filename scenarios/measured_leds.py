"""LEDs measured without a picture: where the image stages would have found them, with errors fitted to the camera's.

A spot of N electrons is taken for a Gaussian of variance

    w^2 = w_0^2 + c (b^2/16 + s^2/12)       b, s: disc out of focus and image of the die [point_spread, eqs 4, 5]  (1)

whose pixels the camera's own exposure control meters. What is sunlit behind it adds a texture of T electrons in an
exposure t. The image stages state of the spot, on each axis,

    sigma^2 = s_0^2 + (a w)^2 (N + N_b)/N^2 + (w T/N)^2                           no pixel at full scale           (2)
    sigma^2 = s_c^2 min(n, n_c)                                                   n pixels                         (3)
    T = T_0 (t/t_0)^q k exp(-q B z)                                               LED at depth z                   (4)

and it is measured with an error of e sigma, e = e_u or e_c. Of the texture's part a share stays with the LED for a
time (Gauss-Markov); the rest is new in every frame. An LED is seen that is on the sensor, not hidden, and whose
brightest pixel reads more than y exp(y_s N(0, 1)) levels above a dark one, y = y_0 + y_T T. A share of the seen, in
proportion to T, gets no name, a share a wrong place. Fewer than `ring_least` LEDs are no ring, and none of them is
named unless a belief that follows does it, that is while the last LEDs that were named are not too old. In a share of
the frames, in proportion to T, no LED is named anyway.

In the light of the fit, that is in daylight, filter and air of the scenario "default", k = 1 and B = 0. Else surfaces
make Y in place of Y_0 electrons a second, LEDs E in place of E_0, and the air takes B more per metre: texture has
Y/Y_0 exp(-B z) of its light. In the fit t^(q-1) stood for the range, as the exposure follows from it. LEDs that are
fainter by d = E/E_0 exp(-B z) take t/d at the same range; so it is (d t)^(q-1) here, and k = Y/Y_0 (E/E_0)^(q-1).

Not modelled: sky, Sun and what they do to the picture (stray light, glints, gaps in clouds, LED-like lights); smear by
motion; a ring that is lost and must be looked for. What a scenario has of these is refused, see `refuse_unmodelled`.
T is the typical LED's: in direct sunlight it is not the same all round the ring.
Source: fitted to the camera and the image stages by the reproduction measurement-model/fit (docs/measurement_model.md).
"""

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.messages import LedObservation, Window
from dockair.rotations import Array
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.defects import Defects
from dockair.sim.camera.electronics import OUTPUT_BITS, output_black, output_gain
from dockair.sim.camera.exposure import ExposureControl
from dockair.sim.camera.image_point import image_points
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import hidden
from dockair.sim.camera.point_spread import blur_px
from dockair.sim.camera.radiometry import Responses, led_electrons
from dockair.sim.camera.readout import latency_s, transfer_jitter_s
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.faults import CameraFault, Faults

_LED_AXIS_D = np.array([-1.0, 0.0, 0.0])  # [docs/notation.md]: LEDs shine aft
_PIXELS = 5  # side of the square of pixels that a spot is metered on
_WHITE = 2**OUTPUT_BITS - 1
_NEAREST_M = 0.1  # depth of a source whose spot has no width that matters: it is not seen


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementParameters:
    """Sheet `measurement_model`."""

    spot_sigma_px: float  #: w_0
    widening_share: float  #: c
    sigma_floor_px: float  #: s_0
    photon_factor: float  #: a
    background_e: float  #: N_b
    texture_e: float  #: T_0
    texture_exposure_s: float  #: t_0
    texture_exponent: float  #: q
    texture_lasting_share: float  #: of the variance of its error
    texture_time_s: float  #: for which that share lasts
    clipped_sigma_px: float  #: s_c
    clipped_most: float  #: n_c
    error_over_sigma: float  #: e_u
    clipped_error_over_sigma: float  #: e_c
    faintest_dn: float  #: y_0
    faintest_dn_per_e: float  #: y_T
    faintest_spread: float  #: y_s
    unnamed_share: float  #: at T_0
    stray_share: float
    stray_px: float  #: standard deviation of a wrong place
    ring_least: int
    no_ring_share: float  #: at T_0
    window_heights: float  #: rows of the window over the height of the ring's image ...
    window_margin_px: float  #: ... and beyond it


@dataclass(frozen=True, slots=True, kw_only=True)
class TextureLight:
    """What a scenario's light makes of the texture, Eq. (4); as it stands, nothing: the light of the fit."""

    factor: float = 1.0  #: k
    extinction_1_m: float = 0.0  #: B


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """The LEDs as the lens has them, without any error."""

    pixels_px: Array  #: (n, 2), NaN behind the lens
    depth_m: Array  #: (n,)
    electrons: Array  #: (n,) of each whole spot
    clear: NDArray[np.bool_]  #: (n,) on the sensor and hidden by nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Numbers:
    """What is drawn for one frame: standard normal, but for the last."""

    new: Array  #: (n, 2)
    stray: Array  #: (n, 2)
    level: Array  #: (n,)
    uniform: Array  #: (n + 1, 2) in [0, 1), the last row the frame's


class MeasuredLeds:
    """Stands where the camera stands in a flight, and gives `LedObservation`s.

    Args:
        parameters: of the errors.
        sheets: of the camera.
        as_built: the hardware.
        response: electrons per second of an LED.
        model: the world's, with bodies "receiver" and "drogue".
        rng: stream "measurements".
        transfer: stream "frame_transfer".
        defects: dirt on the window.
        faults: what breaks, and when.
        followed_s: for how long after LEDs were named the navigation's belief can name LEDs too few for a ring [s].
        extinction_1_m: of the air.
        texture_light: of the texture behind the ring.
        automatic_exposure: whether the camera sets its exposure itself.
    """

    background = ""  #: nobody draws any

    def __init__(
        self,
        parameters: MeasurementParameters,
        sheets: CameraSheets,
        as_built: AsBuilt,
        response: Responses,
        model: mujoco.MjModel,
        *,
        rng: np.random.Generator,
        transfer: np.random.Generator,
        defects: Defects,
        faults: Faults,
        followed_s: float,
        extinction_1_m: float = 0.0,
        texture_light: TextureLight = TextureLight(),
        automatic_exposure: bool = True,
    ) -> None:
        self._p, self._sheets, self._as_built, self._response = parameters, sheets, as_built, response
        self._receiver, self._drogue = model.body("receiver").id, model.body("drogue").id
        self._obstacles, self._extinction_1_m = Obstacles.of(model), extinction_1_m
        self._texture_light = texture_light
        self._rng, self._transfer, self._defects, self._faults = rng, transfer, defects, faults
        self._control = ExposureControl(sheets.exposure, sheets.sensor, automatic=automatic_exposure)
        self._last: LedObservation | None = None
        self._followed_s, self._named_s = followed_s, -np.inf
        self._window, self._exposure_s = as_built.camera.full_window, sheets.exposure.exposure_s
        self._tracking, self._drawn_s = False, -np.inf
        self._lasting = np.zeros((len(as_built.led_intensity_w_sr), 2))
        self._gain, self._black = output_gain(sheets.sensor), output_black(sheets.sensor)

    def expose(
        self,
        data: mujoco.MjData,
        time_s: float,
        frame_number: int,
        window: Window | None,
        exposure_s: float = np.nan,
    ) -> LedObservation | None:
        """Return the LEDs that are named in the frame of the world as it stands; None when the camera has dropped out.

        Args:
            data: positions up to date; only read.
            time_s: middle of the exposure.
            frame_number: not used: frames take their numbers from the stream, one after the other.
            window: not used: what would be read follows from where the ring is.
            exposure_s: asked for, within the sheet's limits, and no business of the exposure control; NaN: its own.
        """
        fault, numbers = self._faults.camera(time_s), self._draw(time_s)
        if fault.dropped:
            transfer_jitter_s(self._sheets.sensor, self._transfer)  # so that later frames take what they took
            return None
        if fault.stuck and self._last is not None:
            return replace(self._last, time_stamp_s=time_s)
        asked = bool(np.isfinite(exposure_s)) and fault.exposure_s is None
        own_s = self._control.exposure_s if fault.exposure_s is None else fault.exposure_s
        exposure_s = self._control.within_limits(exposure_s) if asked else own_s
        view = self.view(data, time_s, exposure_s, fault)
        levels, width_px = self.spots(view)
        self._window = self.window(view) if self._tracking else self._as_built.camera.full_window
        self._exposure_s = exposure_s
        if not asked:
            self._control.step(levels.reshape(1, -1), exposure_s)
        self._last = self._measured(view, levels, width_px, numbers, time_s)
        self._tracking = len(self._last.led_numbers) > 0
        self._named_s = time_s if self._tracking else self._named_s
        return self._last

    @property
    def exposure_s(self) -> float:
        """Of the newest frame."""
        return self._exposure_s

    def view(self, data: mujoco.MjData, time_s: float, exposure_s: float, fault: CameraFault | None = None) -> View:
        """Return where the LEDs are imaged, how bright, and which can be seen."""
        mounting, camera, leds = self._as_built.mounting, self._as_built.camera, self._sheets.leds
        R_WB, R_WD = data.xmat[self._receiver].reshape(3, 3), data.xmat[self._drogue].reshape(3, 3)
        R_WC, p_WC = R_WB @ mounting.R_BC, data.xpos[self._receiver] + R_WB @ mounting.p_BC
        leds_W = data.xpos[self._drogue] + self._as_built.ring_positions_D @ R_WD.T
        p_C = (leds_W - p_WC) @ R_WC
        intensity = self._as_built.led_intensity_w_sr * self._faults.led_factors(time_s, exposure_s)
        axis_C = (R_WD @ _LED_AXIS_D) @ R_WC
        electrons = led_electrons(self._response, leds, intensity, p_C, axis_C, exposure_s, self._extinction_1_m)
        pixels = image_points(camera, p_C)
        last = np.array([camera.width_px - 1, camera.height_px - 1])
        clear = ((pixels >= 0.0) & (pixels <= last)).all(axis=1)  # not where it is NaN
        clear &= ~hidden(self._obstacles, data, p_WC, leds_W, leds.occlusion_clearance_m)
        dirt = None if fault is None else self._defects.dirt(fault.dirt_cover)
        if dirt is not None:
            electrons[clear] *= dirt.at(pixels[clear])
        return View(pixels_px=pixels, depth_m=p_C[:, 0], electrons=electrons, clear=clear)

    def spots(self, view: View) -> tuple[NDArray[np.uint8], Array]:
        """Return (n, 25) grey levels of each spot's pixels without noise, and (n,) its width w [px]."""
        lens, camera = self._sheets.lens, self._as_built.camera
        depth = np.maximum(view.depth_m, _NEAREST_M)
        die_px = camera.focal_length_px * self._sheets.leds.die_size_m / depth
        wider_px2 = blur_px(lens, camera, 1.0 / depth) ** 2 / 16.0 + die_px**2 / 12.0
        width = np.sqrt(self._p.spot_sigma_px**2 + self._p.widening_share * wider_px2)
        electrons = np.where(view.clear, view.electrons, 0.0)
        levels = np.empty((len(width), _PIXELS**2), np.uint8)
        limits = self._gain, self._black, self._sheets.sensor.full_well_e, float(_WHITE)
        _gaussian_levels(np.where(view.clear[:, None], view.pixels_px, 0.0), electrons, width, limits, levels)
        return levels, width

    def texture_e(self, exposure_s: float, depth_m: Array) -> Array:
        """(n,) T of an exposure [electrons] at depths [m], Eq. (4)."""
        p, light = self._p, self._texture_light
        in_fit = p.texture_e * (exposure_s / p.texture_exposure_s) ** p.texture_exponent
        faded = np.exp(-p.texture_exponent * light.extinction_1_m * np.maximum(depth_m, 0.0))
        return np.asarray(in_fit * light.factor * faded)

    def variances(
        self, electrons: Array, width_px: Array, full_pixels: NDArray[np.int64], texture_e: Array
    ) -> tuple[Array, Array]:
        """(n,) stated variance [px^2] of spots, Eqs. (2) and (3), and the texture's part of it."""
        p, n = self._p, np.maximum(electrons, 1.0)
        texture = np.where(full_pixels > 0, 0.0, (width_px * texture_e / n) ** 2)
        clipped = p.clipped_sigma_px**2 * np.minimum(full_pixels, p.clipped_most)
        unclipped = p.sigma_floor_px**2 + (p.photon_factor * width_px) ** 2 * (n + p.background_e) / n**2
        return np.where(full_pixels > 0, clipped, unclipped + texture), texture

    def latency_s(self, frame: LedObservation) -> float:
        """Draw the time [s] from the newest observation's stamp until it has arrived."""
        sensor = self._sheets.sensor
        return latency_s(self._window, sensor, self._exposure_s) + transfer_jitter_s(sensor, self._transfer)

    def close(self) -> None:
        """Nothing to free."""

    def _measured(
        self, view: View, levels: NDArray[np.uint8], width_px: Array, numbers: _Numbers, time_s: float
    ) -> LedObservation:
        p, full, count, uniform = self._p, (levels == _WHITE).sum(axis=1), len(width_px), numbers.uniform
        texture_e = self.texture_e(self._exposure_s, view.depth_m)
        variance, texture = self.variances(view.electrons, width_px, full, texture_e)
        lasting = p.texture_lasting_share * texture
        ratio = np.where(full > 0, p.clipped_error_over_sigma, p.error_over_sigma)[:, None]
        error = np.sqrt(variance - lasting)[:, None] * numbers.new + np.sqrt(lasting)[:, None] * self._lasting
        error = ratio * error + np.where(uniform[:count, 1:] < p.stray_share, p.stray_px * numbers.stray, 0.0)
        faintest_dn, clutter = p.faintest_dn + p.faintest_dn_per_e * texture_e, texture_e / max(p.texture_e, 1.0)
        contrast_dn = above_dark_dn(levels.max(axis=1), self._black)
        bright = contrast_dn > faintest_dn * np.exp(p.faintest_spread * numbers.level)
        named = np.flatnonzero(view.clear & bright & (uniform[:count, 0] >= clutter * p.unnamed_share))
        least = 1 if time_s - self._named_s <= self._followed_s else p.ring_least
        if len(named) < least or uniform[count, 0] < np.median(clutter) * p.no_ring_share:  # where the ring is
            named = named[:0]
        return LedObservation(
            time_stamp_s=time_s,
            led_numbers=named,
            centroids_px=(view.pixels_px + error)[named],
            sigma_px=np.sqrt(variance[named]),
        )

    def _draw(self, time_s: float) -> _Numbers:
        """Random numbers of a frame, as many whatever becomes of it; the lasting errors are moved on to its time."""
        count = len(self._lasting)
        new, stray, lasting = self._rng.standard_normal((3, count, 2))
        level, uniform = self._rng.standard_normal(count), self._rng.random((count + 1, 2))
        kept = np.exp((self._drawn_s - time_s) / self._p.texture_time_s)  # 0 at the first: nothing is kept
        self._lasting, self._drawn_s = kept * self._lasting + np.sqrt(1.0 - kept**2) * lasting, time_s
        return _Numbers(new=new, stray=stray, level=level, uniform=uniform)

    def window(self, view: View) -> Window:
        """The rows that the navigation would ask for; columns cost no time."""
        camera, seen = self._as_built.camera, view.pixels_px[view.clear, 1]
        if not len(seen):
            return camera.full_window
        middle = 0.5 * (seen.min() + seen.max())
        half = 0.5 * (self._p.window_heights * (seen.max() - seen.min()) + self._p.window_margin_px)
        first, stop = max(int(middle - half), 0), min(int(middle + half) + 1, camera.height_px)
        return Window(first, stop, 0, camera.width_px)


def above_dark_dn(level: NDArray[np.integer[Any]], black_dn: float) -> Array:
    """Grey levels of `MeasuredLeds.spots` above that of a pixel without light, which is cut to a whole one as they are.

    This is what image stages see of a spot: its pixels beside those around it, not beside a black of 2.5 levels that no
    pixel reads.

    Args:
        level: any shape.
        black_dn: of the output before it is cut.
    """
    return np.asarray(level - np.floor(black_dn))


@njit(cache=True)
def _gaussian_levels(
    pixels: Array, electrons: Array, width_px: Array, limits: tuple[float, float, float, float], out: NDArray[np.uint8]
) -> None:
    """Fill (n, 25) grey levels of Gaussian spots sampled at the pixels around their centres."""
    gain, black, full_well, top = limits
    half = _PIXELS // 2
    for i in range(len(electrons)):
        u0, v0 = np.floor(pixels[i, 0] + 0.5), np.floor(pixels[i, 1] + 0.5)
        peak = electrons[i] / (2.0 * np.pi * width_px[i] ** 2)
        for row in range(_PIXELS):
            for column in range(_PIXELS):
                du, dv = u0 + column - half - pixels[i, 0], v0 + row - half - pixels[i, 1]
                e = peak * np.exp(-0.5 * (du * du + dv * dv) / width_px[i] ** 2)
                level = black + gain * min(e, full_well)
                out[i, row * _PIXELS + column] = np.uint8(min(np.floor(level), top))
