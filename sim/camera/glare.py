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
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.ghosts import CompactGhosts, Ghosts
from dockair.sim.camera.halo import Halo
from dockair.sim.camera.iris import Iris, Spikes
from dockair.sim.camera.occlusion import VISIBLE_GROUPS
from dockair.sim.camera.radiometry import Responses
from dockair.sim.camera.sheets import GlareParameters, LensParameters, LightParameters
from dockair.sim.camera.sun_disc import add_disc, image_of_disc

__all__ = ["CoarseGrid", "CompactGhosts", "Glare"]

_WING_EXPONENT: Final = 1.5  # of the round part of the diffraction's wing, [iris, eq 2]
_MARGIN: Final = 1.3  # beyond the corners, to which the lens's distortion is taken as its polynomial
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
        self._widest = _MARGIN * float(np.max(np.linalg.norm(_corners(camera)[:, 1:], axis=1)))
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
        sun_px = self._image_of(sun_C)
        electrons = self._flux_e_s * float(sun_C[0]) * visible_s
        return sun_px, electrons * math.exp(-((self._outside_rad(sun_px) / self._parameters.veiling_decay_rad) ** 2))

    def _halo_electrons(self, electrons: float, veil_factor: float) -> Array:
        """(n,) strength of each part of the halo; the last is diffraction, which dirt does not change."""
        return electrons * np.append(np.full(len(self._halo.shares) - 1, veil_factor), 1.0)

    def _image_of(self, sun_C: Array) -> Array:
        """(2,) pixel of the Sun; beyond the field, where the distortion's polynomial ends, shifted as at its edge."""
        ab = -sun_C[1:] / sun_C[0]
        c, f = np.array(self._camera.principal_point_px), self._camera.focal_length_px
        if self._camera.distortion is None:
            return np.asarray(c + f * ab)
        inner = ab * min(1.0, self._widest / max(math.hypot(*ab), 1e-12))
        direction = np.array([[1.0, -inner[0], -inner[1]]])
        return np.asarray(self._camera.pixels_from_points(direction)[0] + f * (ab - inner))

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
        if lost < 0.0 or self._wing >= 1.0:
            raise DockairError(
                "glare", expected="transmittance x (1 + veil + halo + ghosts) <= 1", got=round(1.0 - lost, 4)
            )


def _check_shapes(parameters: GlareParameters) -> None:
    if parameters.iris_blades in (1, 2):
        raise DockairError("glare.iris_blades", expected="0 (round) or at least 3", got=parameters.iris_blades)
    for names in (
        ("halo_share", "halo_core_rad", "halo_exponent"),
        ("ghost_position", "ghost_defocus_m", "ghost_share"),
    ):
        lengths = [len(getattr(parameters, name)) for name in names]
        if len(set(lengths)) > 1:
            raise DockairError(f"glare.{names[0]}", expected=f"as many values as {names[1]}, {names[2]}", got=lengths)


def _corners(camera: Camera) -> Array:
    """(4, 3) directions to the array's corners at x = 1, distortion left out."""
    (c_u, c_v), f = camera.principal_point_px, camera.focal_length_px
    u, v = np.meshgrid([0.0, camera.width_px - 1.0], [0.0, camera.height_px - 1.0])
    return np.column_stack([np.ones(4), -(u.ravel() - c_u) / f, -(v.ravel() - c_v) / f])


RIM_GEOMS = "basket_rim"  #: how the names of the rim's pieces begin
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it
_FIXED_POINT_STEPS = 6  # of (2) and (3), for the direction from the point to the camera; error falls by size/range
_FLATTEST = 0.05  # seen along the rim's axis a whole circle would glint; a real rim's waviness limits it
_ROUND = (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Glints:
    """Specular points that both the Sun and the camera see."""

    p_W: Array  #: (n, 3) [m]
    r1_r2_m2: Array  #: (n,) product of the principal radii


@dataclass(frozen=True, slots=True, kw_only=True)
class Rim:
    """The basket's rim as a torus about its body's x axis."""

    body: int
    centre_x_m: float
    radius_m: float
    tube_radius_m: float


def rim_of(model: mujoco.MjModel) -> Rim | None:
    """Return the torus through the capsules that draw the rim; None where the scene has none."""
    pieces = [i for i in range(model.ngeom) if model.geom(i).name.startswith(RIM_GEOMS)]
    if not pieces:
        return None
    middle = model.geom_pos[pieces]
    chord = np.hypot(middle[:, 1], middle[:, 2])
    return Rim(
        body=int(model.geom_bodyid[pieces[0]]),
        centre_x_m=float(middle[:, 0].mean()),
        radius_m=float(np.hypot(chord, model.geom_size[pieces, 1]).mean()),
        tube_radius_m=float(model.geom_size[pieces, 0].mean()),
    )


def is_clear(model: mujoco.MjModel, data: mujoco.MjData, p_W: Array, direction_W: Array, distance_m: float) -> bool:
    """Say whether nothing visible lies within `distance_m` of p_W along a unit vector."""
    which = np.zeros(1, dtype=np.int32)
    hit = mujoco.mj_ray(model, data, p_W, direction_W, VISIBLE_GROUPS, 1, -1, which)
    return hit < 0.0 or hit >= distance_m


def find_glints(
    model: mujoco.MjModel, data: mujoco.MjData, rim: Rim | None, p_WC: Array, s_W: Array, light: LightParameters
) -> Glints:
    """Return the glints in the scene, Eqs. (2) to (4).

    Args:
        model: geoms; those in hidden groups or fully transparent throw none.
        data: their poses, up to date; not changed.
        rim: of `rim_of`.
        p_WC: (3,) the lens [m].
        s_W: (3,) unit vector toward the Sun.
        light: the limit of incidence.
    """
    seen = VISIBLE_GROUPS[model.geom_group].astype(bool) & (model.geom_rgba[:, 3] > 0.0)
    found = [_on_ellipsoids(model, data, p_WC, s_W, np.flatnonzero(seen & np.isin(model.geom_type, _ROUND)))]
    if rim is not None:
        found += [_on_rim(data, rim, p_WC, s_W, side) for side in (1.0, -1.0)]
    p, n, area = (np.concatenate(column) for column in zip(*found, strict=True))
    kept = [i for i in range(len(p)) if _is_lit_and_seen(model, data, p[i], n[i], p_WC, s_W, light)]
    return Glints(p_W=p[kept], r1_r2_m2=area[kept])


def _on_ellipsoids(
    model: mujoco.MjModel, data: mujoco.MjData, p_WC: Array, s_W: Array, which: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Points (m, 3), normals (m, 3) and products of radii (m,), Eq. (3)."""
    sphere = (model.geom_type[which] == mujoco.mjtGeom.mjGEOM_SPHERE)[:, None]
    A = np.where(sphere, model.geom_size[which, :1], model.geom_size[which])
    R, centre = data.geom_xmat[which].reshape(-1, 3, 3), data.geom_xpos[which]
    p, n, support = centre, np.zeros_like(centre), np.ones(len(which))
    for _ in range(_FIXED_POINT_STEPS):
        n = _bisector(s_W, p_WC - p)
        n_local = np.einsum("mji,mj->mi", R, n)
        support = np.linalg.norm(A * n_local, axis=1)
        p = centre + np.einsum("mij,mj->mi", R, A**2 * n_local / support[:, None])
    return p, n, np.prod(A, axis=1) ** 2 / support**4


def _on_rim(data: mujoco.MjData, rim: Rim, p_WC: Array, s_W: Array, side: float) -> tuple[Array, Array, Array]:
    """The rim's outer (side 1) or inner (side -1) specular point, Eq. (4); shapes as of `_on_ellipsoids`."""
    x = data.xmat[rim.body].reshape(3, 3)[:, 0]
    p = centre = data.xpos[rim.body] + rim.centre_x_m * x
    n = e = np.zeros(3)
    for _ in range(_FIXED_POINT_STEPS):
        n = _bisector(s_W, (p_WC - p)[None])[0]
        radial = n - (n @ x) * x
        e = side * radial / max(float(np.linalg.norm(radial)), np.finfo(float).tiny)
        p = centre + rim.radius_m * e + rim.tube_radius_m * n
    slope = max(abs(float(n @ e)), _FLATTEST)
    area = rim.tube_radius_m * abs(rim.radius_m + rim.tube_radius_m * float(n @ e)) / slope
    return p[None], n[None], np.array([area])


def _bisector(s: Array, v: Array) -> Array:
    """(m, 3) unit vectors half-way between s (3,) and v (m, 3), Eq. (2)."""
    both = s + v / np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(both / np.maximum(np.linalg.norm(both, axis=1, keepdims=True), np.finfo(float).tiny))


def _is_lit_and_seen(
    model: mujoco.MjModel, data: mujoco.MjData, p: Array, n: Array, p_WC: Array, s_W: Array, light: LightParameters
) -> bool:
    ray = p_WC - p
    distance = float(np.linalg.norm(ray))
    if n @ s_W < math.cos(light.glint_grazing_rad):  # as n halves the angle, the camera stands on the lit side too
        return False
    start = p + _SKIN_M * n
    return is_clear(model, data, start, ray / distance, distance) and is_clear(model, data, start, s_W, np.inf)
