"""Light that the lens puts where it does not belong, with the Sun in or near the picture: veil, halo, spikes, ghosts.

All are shares of the light F that the lens images regularly,

    F = S A cos t v t_exp,      strength  F exp(-(d/d0)^2)                                                       (1)

with S A all sunlight through the aperture [radiometry], t the Sun's angle off the axis, v the visible part of its disc
and d how far it stands outside the field, where the hood keeps light from the glass.

    veil    g / pixels            everywhere alike, g the glare index of ISO 9358                                (2)
    halo    [halo]                scattered by surfaces and dust, and the round part of the diffraction's wing
    spikes  [iris]                the wing's part that straight blades gather; both come out of the disc
    ghosts  [ghosts]
    disc    1 - wing              [sun_disc]

Of what enters the lens, with T its transmittance, T (1 + g + halo + ghosts) reaches the sensor's plane and the rest is
lost: absorbed or thrown back. A sheet that spends more than there is, is refused.

What is smooth goes to a coarse grid; the middle of the halo and compact ghosts are added pixel by pixel. Not so the
spikes, which are as wide as the disc. Nothing here is random.
Not modelled: stray light of bright clouds and LEDs, baffles' own reflections, the hood's shape.
Sources: ISO 9358 (glare index); the parts name theirs.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.ghosts import CompactGhosts, Ghosts
from dockair.sim.camera.halo import Halo
from dockair.sim.camera.image_point import image_point
from dockair.sim.camera.iris import Iris, Spikes
from dockair.sim.camera.radiometry import Responses
from dockair.sim.camera.sheets import GlareParameters, LensParameters, LightParameters
from dockair.sim.camera.sun_disc import add_disc, image_of_disc

__all__ = ["CoarseGrid", "CompactGhosts", "Glare"]

_WING_EXPONENT: Final = 1.5  # of the round part of the diffraction's wing, [iris, eq 2]
_FAINTEST_E: Final = 1.0  # stray light of so little strength gives no pixel a measurable part


class Glare:
    """What the Sun does in one lens."""

    def __init__(
        self,
        parameters: GlareParameters,
        lens: LensParameters,
        camera: Camera,
        light: LightParameters,
        response: Responses,
        wavelength_m: float,
    ) -> None:
        """Prepare tables.

        Args:
            parameters: sheet `glare`.
            lens: f-number, transmittance.
            camera: as built.
            light: the Sun's angular radius.
            response: electrons of the Sun.
            wavelength_m: of the diffraction.

        Raises:
            DockairError: an iris of one or two blades; more light asked for than enters; lists of unequal length.
        """
        self._parameters, self._camera, self._flux_e_s = parameters, camera, response.sun_flux_e_s
        self._sun_radius_rad, self._transmittance = light.sun_angular_radius_rad, lens.transmittance
        _check_shapes(parameters)
        radius = camera.focal_length_px * math.tan(light.sun_angular_radius_rad)
        iris = Iris(blades=parameters.iris_blades, angle_rad=parameters.iris_angle_rad)
        wing = iris.wing_px(wavelength_m, lens.f_number, camera.pixel_pitch_m) / radius
        self._spikes = Spikes(iris, wing * parameters.spike_share, radius, parameters.spike_fan_rad)
        self._halo = Halo(
            np.append(parameters.halo_share, wing - self._spikes.share),
            np.append(parameters.halo_core_rad * camera.focal_length_px, radius),
            np.append(parameters.halo_exponent, _WING_EXPONENT),
            radius,
        )
        pupil = parameters.ghost_defocus_m / (2.0 * lens.f_number * camera.pixel_pitch_m)
        self._ghosts = Ghosts(
            iris, parameters.ghost_position, parameters.ghost_share, pupil, radius, camera.principal_point_px
        )
        self._wing = wing
        self._check_budget()

    @property
    def shares(self) -> dict[str, float]:
        """Where the light goes that enters the lens; the sum is 1."""
        T, g = self._transmittance, self._parameters.veiling_glare
        parts = {
            "disc": T * (1.0 - self._wing),
            "halo": T * float(self._halo.shares.sum()),
            "spikes": T * self._spikes.share,
            "veil": T * g,
            "ghosts": T * self._ghosts.share,
        }
        return parts | {"lost": 1.0 - sum(parts.values())}

    def stray(
        self, sun_C: Array, visible: float, exposure_s: float, window: Window, veil_factor: float = 1.0
    ) -> CoarseGrid | None:
        """Veil, halo, spikes and large ghosts [e-/px]; None where the Sun gives nothing.

        Args:
            sun_C: (3,) unit vector toward the Sun, camera axes.
            visible: part of its disc that nothing hides, clouds included, 0 to 1.
            exposure_s: exposure time.
            window: what is read; the grid encloses it.
            veil_factor: of a dirty window, on veil and halo.
        """
        sun_px, electrons = self._source(sun_C, visible * exposure_s)
        if electrons < _FAINTEST_E:
            return None
        first, shape = nodes_around(window)
        veil = veil_factor * self._parameters.veiling_glare * electrons
        values = np.full(shape, veil / (self._camera.width_px * self._camera.height_px), dtype=np.float32)
        centre = float(sun_px[0]), float(sun_px[1])
        self._halo.add_to_grid(values, first, centre, self._halo_electrons(electrons, veil_factor))
        self._spikes.add_to_grid(values, first, centre, electrons)
        self._ghosts.add_to_grid(values, first, sun_px, electrons)
        return CoarseGrid(values, first)

    def add_fine(
        self,
        image: NDArray[np.float32],
        start: tuple[int, int],
        sun_C: Array,
        visible: float,
        exposure_s: float,
        veil_factor: float = 1.0,
    ) -> None:
        """Add what the coarse grid cannot hold, the middle of the halo and the compact ghosts, in place.

        Args:
            image: (rows, columns) expected electrons of the window.
            start: (row, column) of its first pixel on the sensor.
            sun_C: as of `stray`, like the rest.
            visible: as of `stray`.
            exposure_s: exposure time.
            veil_factor: as of `stray`.
        """
        sun_px, electrons = self._source(sun_C, visible * exposure_s)
        if electrons < _FAINTEST_E:
            return
        centre = float(sun_px[0]), float(sun_px[1])
        self._halo.add_to_pixels(image, start, centre, self._halo_electrons(electrons, veil_factor))
        self._ghosts.add_to_pixels(image, start, sun_px, electrons)

    def compact_ghosts(self, sun_C: Array, visible: float, exposure_s: float) -> CompactGhosts:
        """Ghosts that `add_fine` adds: truth, for logs and tests. Arguments as of `stray`."""
        return self._ghosts.compact(*self._source(sun_C, visible * exposure_s))

    def add_disc(
        self,
        image: NDArray[np.float32],
        start: tuple[int, int],
        sun_C: Array,
        transmittance: Array,
        first: tuple[int, int],
        exposure_s: float,
        edge_sigma_px: float,
    ) -> None:
        """Add the Sun's disc to expected electrons, in place.

        Args:
            image: (rows, columns) of the window.
            start: (row, column) of its first pixel on the sensor.
            sun_C: (3,) unit vector toward the Sun, camera axes; nothing is added where it is behind.
            transmittance: (m, n) of each pixel around the disc, 0 (hidden) to 1; pixels outside get nothing.
            first: (row, column) on the sensor of its first pixel.
            exposure_s: exposure time.
            edge_sigma_px: blur of the edge.
        """
        if sun_C[0] <= 0.0:
            return
        electrons = self._flux_e_s * exposure_s * float(sun_C[0]) * (1.0 - self._wing)
        disc = image_of_disc(self._camera, sun_C, self._sun_radius_rad)
        add_disc(image, start, disc, electrons, transmittance, first, edge_sigma_px)

    def _source(self, sun_C: Array, visible_s: float) -> tuple[Array, float]:
        """Place of the Sun's image (2,) [px] and strength of its stray light [e-], Eq. (1)."""
        if sun_C[0] <= 0.0:
            return np.zeros(2), 0.0
        sun_px = image_point(self._camera, sun_C)
        electrons = self._flux_e_s * float(sun_C[0]) * visible_s
        return sun_px, electrons * math.exp(-((self._outside_rad(sun_px) / self._parameters.veiling_decay_rad) ** 2))

    def _halo_electrons(self, electrons: float, veil_factor: float) -> Array:
        """(n,) strength of each part of the halo; the last is diffraction, which dirt does not change."""
        return electrons * np.append(np.full(len(self._halo.shares) - 1, veil_factor), 1.0)

    def _outside_rad(self, pixel: Array) -> float:
        """Angle from a pixel (2,), on or off the sensor, to the nearest one on it."""
        (c_u, c_v), f = self._camera.principal_point_px, self._camera.focal_length_px
        u, v = float(pixel[0]), float(pixel[1])
        edge_u = min(max(u, 0.0), self._camera.width_px - 1.0)
        edge_v = min(max(v, 0.0), self._camera.height_px - 1.0)
        a, b = (u - c_u, v - c_v, f), (edge_u - c_u, edge_v - c_v, f)
        cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
        return math.atan2(math.hypot(*cross), sum(x * y for x, y in zip(a, b, strict=True)))

    def _check_budget(self) -> None:
        lost = self.shares["lost"]
        if lost < 0.0:
            raise DockairError(
                "parameters.glare", expected="transmittance x (1 + veil + halo + ghosts) <= 1", got=round(1.0 - lost, 4)
            )


def _check_shapes(parameters: GlareParameters) -> None:
    where = "parameters.glare"
    if parameters.iris_blades in (1, 2):
        raise DockairError(f"{where}.iris_blades", expected="0 (round) or at least 3", got=parameters.iris_blades)
    for first, *others in (
        ("halo_share", "halo_core_rad", "halo_exponent"),
        ("ghost_position", "ghost_defocus_m", "ghost_share"),
    ):
        lengths = [len(getattr(parameters, name)) for name in (first, *others)]
        if len(set(lengths)) > 1:
            raise DockairError(f"{where}.{first}", expected=f"as many values as {', '.join(others)}", got=lengths)
