"""How bright it is toward any direction: clear sky, cloud above with gaps, cloud deck and ground below, haze, night.

Relative radiance, 1 = a white Lambertian surface in normal sunlight, toward a direction in W: c is the cosine of the
angle X from the Sun, s the sine of the elevation.

    J(c) = airlight f,   f = 1 + a (exp(-d X) - exp(-d pi/2)) + e c^2                                           (1)
    clear sky   J (1 - exp(-b m)),   b = -ln(1 - zenith/airlight),   m = 1/(|s| + 0.025 exp(-11 |s|))              (2)
                below level, down to the lowest point and up:  80 exp(D/H) - m,   D = r (1 - sqrt(1 - s^2))
    cloud above at (x, y) = height (d_x, d_y)/(s + w), crossed at mu = (s + w)/(1 + w)                             (3)
    surface below, depth h down:  d = -r s - sqrt(q),  q = (r - h)^2 - r^2 (1 - s^2),  mu = sqrt(q)/(r - h)          (4)
    deck        R min(mu_0 (1 + w n), 1) + (1 - R) (what is below),   R = 1 - T(t),   t = tau (1 + w)/(mu + w)     (5)
    air before  L <- L exp(-b' m) + J' (1 - exp(-b' m)),   b' = aerosol (exp(-z_1/H) - exp(-z_2/H))                (6)
    haze        L <- L exp(-b_h m) + J_h (1 - exp(-b_h m)),   b_h = (3.912/V - 3.912/V_clear) depth, not below 0   (7)

Eq. (1) is the CIE clear sky's indicatrix, which is 1 at 90 degrees; (2) its gradation, scaled so that the zenith and
endless air at 90 degrees from the Sun are the sheet's. w is the thickness of cloud elements over their width: it keeps
slant paths finite where a layer is seen edge-on. J' has less Sun in it where cloud shades the air (mean of the
layer); J_h less where the haze itself does. The light that cloud sends down is `clouds`, and 1 - T of what the ground
below it sends up. Cloud, deck and haze are lit while the Sun stands above the horizon that their own height sees; the
clear sky and the air stay as they are.

Land is patches of all sizes, darker and lighter, and water. Deck and ground are asked for from the place of the camera,
the key; what is above goes along with the camera, as W does.
Not modelled: wind, twilight, moon, vapour trails, shadows on the deck, polarisation; cloud at flight level but as haze.
Cloud above is one layer that starts over the aircraft; within it, or under the deck's top, this is not valid.
Sources: ISO 15469 (CIE S 011), sky type 12; Rozenberg 1966 (air mass at the horizon); 3.912/V as in radiometry (7).
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from dockair.rotations import Array
from dockair.sim.camera.clouds import Droplets, Texture, optical_depth
from dockair.sim.camera.earth import air_mass, dip_sine, meet_sphere, unit
from dockair.sim.camera.radiometry import extinction_1_m
from dockair.sim.camera.sheets import SkyParameters
from dockair.sim.camera.weather import Weather

#: Nodes of the pictures' tables [sky]: what is finer is left out of cloud above, and of deck and ground.
NODE_RAD, LAYER_NODE_RAD = 2.0 / (64 * 48), 2.0 / (64 * 32)
_OVERHEAD = (0.0, 0.0, 1.0)
#: Keys apart: cloud above, deck, ground, coasts.
_LAYERS = 0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0xD6E8FEB86659FD93, 0xA0761D6478BD642F
_COAST = 0.1  # standard deviations of the noise over which land turns into water
_AMBIENT_DIRECTIONS = 1024


class SkyRadiance:
    """Radiance and transmittance by direction; its answers depend on nothing that was asked before."""

    def __init__(
        self, parameters: SkyParameters, weather: Weather, sun_direction_W: Array | None, altitude_m: float, key: int
    ) -> None:
        """Set up.

        Args:
            parameters: sheet.
            weather: of the flight.
            sun_direction_W: (3,) toward the Sun, of any length; None is overhead.
            altitude_m: of the camera above the ground.
            key: 64 bits of the stream "clouds".
        """
        p = self.parameters = parameters
        self.weather, self.altitude_m = weather, altitude_m
        sun = np.array(_OVERHEAD if sun_direction_W is None else sun_direction_W, dtype=float)
        self._sun = sun / math.sqrt(float(sun @ sun))
        self._mu_sun = (max(float(self._sun[2]), 0.0) + p.cloud_aspect) / (1.0 + p.cloud_aspect)
        self._sine_sun = max(float(self._sun[2]), 0.0)
        self._droplets = Droplets(
            asymmetry=p.cloud_asymmetry, size_parameter=2.0 * math.pi * p.droplet_radius_m / p.wavelength_m
        )
        cells = p.cloud_cell_m, p.deck_cell_m, p.ground_cell_m, p.coast_cell_m
        self._above, self._deck, self._ground, self._coasts = (
            Texture(key=key ^ layer, cell_m=cell, spectral_exponent=p.cloud_spectral_exponent)
            for layer, cell in zip(_LAYERS, cells, strict=True)
        )
        self._clear_depth = -math.log(1.0 - p.zenith / p.airlight)
        self._clear_share = 1.0 - math.exp(-p.cloud_height_m / p.aerosol_scale_m)  # of the air, under the cloud
        excess = extinction_1_m(weather.visibility_m) - extinction_1_m(p.clear_visibility_m)
        self._haze_depth = max(excess, 0.0) * p.haze_depth_m
        self._shade()
        self.top_m = p.deck_top_m if self.has_deck else 0.0  #: of what is met first from above
        self.ambient = self._ambient()  #: mean relative radiance of all directions: what lights the Sun's lee

    def beam(self, directions_W: Array) -> Array:
        """Return (n,) transmittance of cloud and haze for sunlight from (n, 3) directions; 1 without either.

        A deck counts where the ray goes into it from the start, with the air before it: exp(-t) of Eq. (5).
        """
        d = unit(directions_W)
        if self.weather.night:
            return np.zeros(len(d))
        mu = self._slope(d) / (1.0 + self.parameters.cloud_aspect)
        through = np.exp(-self._depth_above(d) / mu - self._haze_depth * air_mass(d[:, 2]))
        if self.has_deck:
            met = np.flatnonzero(self._surface(d[:, 2], self.top_m)[0])
            _, depth = self._deck_along(d[met], np.zeros(3))
            through[met] *= np.exp(-depth) * self._clear(d[met, 2], self.top_m, self.altitude_m)
        ground = self._surface(d[:, 2], 0.0)[0] if self.altitude_m > 0.0 else d[:, 2] < 0.0
        return np.where(ground, 0.0, through)

    def airlight(self, direction_W: Array) -> float:
        """Return the relative radiance of endless haze toward a direction (3,): what far objects fade into."""
        if self.weather.night:
            return self.parameters.night
        (x, y, z), (a, b, c) = np.asarray(direction_W).tolist(), self._sun.tolist()
        cosine = (x * a + y * b + z * c) / math.sqrt(x * x + y * y + z * z)
        return float(self._haze(np.array(min(max(cosine, -1.0), 1.0))))

    def radiance(self, directions_W: Array) -> Array:
        """Return (n,) relative radiances toward (n, 3) directions at the start: what `fill` reads between nodes."""
        return self._radiance(unit(directions_W), with_aureole=True)

    def _radiance(self, d: Array, with_aureole: bool) -> Array:
        if self.weather.night:
            return np.full(len(d), self.parameters.night)
        out, here = self.upward(d, with_aureole), np.zeros(3)
        down = np.flatnonzero(self._surface(d[:, 2], self.top_m)[0])
        out[down] = self.below(d[down], here)[:, 0]
        if self.has_deck:
            light, clear = self.over(d[down], here).T
            out[down] = light + clear * out[down]
        return out

    def upward(self, d: Array, with_aureole: bool = True) -> Array:
        """Sky behind haze; where there is a layer, as if there were none."""
        return self._behind_haze(self._sky(d, self._cosine(d), with_aureole), d)

    def below(self, d: Array, key_m: Array) -> Array:
        """(n, 1) ground from a place; sky where a ray passes it. Behind haze, but for when a deck is before it."""
        cosine = self._cosine(d)
        out = self._sky(d, cosine, with_aureole=True)
        down = np.flatnonzero(self._surface(d[:, 2], 0.0, float(key_m[2]))[0])
        out[down] = self._land(d[down], cosine[down], key_m)
        return (out if self.has_deck else self._behind_haze(out, d))[:, None]

    def over(self, d: Array, key_m: Array) -> Array:
        """(n, 2) light of the deck from a place, behind haze, and transmittance of deck, air and haze before it."""
        light, through = self._cloud_deck(d, self._cosine(d), key_m)
        return np.column_stack([self._behind_haze(light, d), through * np.exp(-self._haze_depth * air_mass(d[:, 2]))])

    def _behind_haze(self, light: Array, d: Array) -> Array:
        clear = np.exp(-self._haze_depth * air_mass(d[:, 2]))
        return np.asarray(light * clear + self._haze(self._cosine(d)) * (1.0 - clear))

    def _cosine(self, d: Array) -> Array:
        s = self._sun
        return np.clip(d[:, 0] * s[0] + d[:, 1] * s[1] + d[:, 2] * s[2], -1.0, 1.0)

    def _sky(self, d: Array, cosine: Array, with_aureole: bool) -> Array:
        """Clear sky, Eq. (2), and the cloud in it, Eq. (3)."""
        mass = self._clear_mass(d[:, 2])
        before = np.exp(-self._clear_share * self._clear_depth * mass)
        beyond = self._source(cosine, 1.0, 1.0) * (before - np.exp(-self._clear_depth * mass))
        front = self._source(cosine, self._light_below, self._direct_below) * (1.0 - before)
        if self.weather.cloud_cover <= 0.0:
            return np.asarray(front + beyond)
        depth = self._depth_above(d)
        mu = self._slope(d) / (1.0 + self.parameters.cloud_aspect)
        light = self._droplets.diffuse(depth, mu, self._mu_sun, cosine)
        light += (
            self.parameters.ground_reflectance
            * self._sine_sun
            * self._light_below
            * (1.0 - self._droplets.transmittance(depth))
        )
        if with_aureole:
            light += self._droplets.aureole(depth, mu, cosine)
        return np.asarray(front + before * self._lit_above * light + beyond * np.exp(-depth / mu))

    def _land(self, d: Array, cosine: Array, key_m: Array) -> Array:
        """The ground through the air under the deck's top (or under the aircraft), Eqs. (4) and (6)."""
        p = self.parameters
        _, distance, mu = self._surface(d[:, 2], 0.0, float(key_m[2]))
        at = key_m[0] + d[:, 0] * distance, key_m[1] + d[:, 1] * distance, LAYER_NODE_RAD * distance / np.sqrt(mu)
        land = p.ground_reflectance * np.maximum(1.0 + p.ground_contrast * self._ground.at(*at), 0.0)
        if p.water_cover > 0.0:
            shore = float(ndtri(1.0 - p.water_cover))
            water = np.clip(0.5 + (self._coasts.at(*at) - shore) / _COAST, 0.0, 1.0)
            land += water * (p.water_reflectance - land)
        light = land * self._sine_sun * self._light_below
        return self._through_air(light, d[:, 2], cosine, 0.0, p.deck_top_m if self.has_deck else self.altitude_m)

    def _cloud_deck(self, d: Array, cosine: Array, key_m: Array) -> tuple[Array, Array]:
        """Light of the deck with the air before it, and the transmittance of both, Eqs. (4) to (6)."""
        p = self.parameters
        noise, depth = self._deck_along(d, key_m)
        reflectance = 1.0 - self._droplets.transmittance(depth)
        facing = np.clip(self._mu_sun * (1.0 + p.cloud_aspect * noise), 0.0, 1.0)
        light, high = reflectance * facing * self._light_below * self._lit_deck, self.altitude_m
        clear = self._clear(d[:, 2], p.deck_top_m, high)
        return self._through_air(light, d[:, 2], cosine, p.deck_top_m, high), (1.0 - reflectance) * clear

    def _deck_along(self, d: Array, key_m: Array) -> tuple[Array, Array]:
        """Noise of the deck where rays (n, 3) meet it, and its optical depth along them, t of Eq. (5)."""
        p = self.parameters
        _, distance, mu = self._surface(d[:, 2], p.deck_top_m, float(key_m[2]))
        at = key_m[0] + d[:, 0] * distance, key_m[1] + d[:, 1] * distance, LAYER_NODE_RAD * distance / np.sqrt(mu)
        noise = self._deck.at(*at)
        depth = optical_depth(noise, p.deck_cover, p.deck_optical_depth)
        return noise, depth * (1.0 + p.cloud_aspect) / (mu + p.cloud_aspect)

    def _through_air(self, light: Array, sine: Array, cosine: Array, low_m: float, high_m: float) -> Array:
        """Light from below through the clear air between two heights, Eq. (6)."""
        clear = self._clear(sine, low_m, high_m)
        return np.asarray(light * clear + self._source(cosine, self._light_below, self._direct_below) * (1.0 - clear))

    def _clear(self, sine: Array, low_m: float, high_m: float) -> Array:
        p = self.parameters
        depth = p.aerosol_optical_depth * (math.exp(-low_m / p.aerosol_scale_m) - math.exp(-high_m / p.aerosol_scale_m))
        return np.asarray(np.exp(-depth * air_mass(sine)))

    def _source(self, cosine: Array, light: float, direct: float) -> Array:
        """J of Eq. (1) in air that `light` of all sunlight reaches, `direct` of that as a beam."""
        return np.asarray(self.parameters.airlight * light * (1.0 + direct * self.parameters.beyond_even(cosine)))

    def _haze(self, cosine: Array) -> Array:
        """J_h of Eq. (7): the beam that gets through the haze makes J, the rest of the light is the same all round."""
        beam, rest = self._haze_light
        return self._source(cosine, self._light_below, self._direct_below) * beam + rest

    def _shade(self) -> None:
        """Mean light under the layer above, and how much of it still is a beam; of that in haze, beam and rest."""
        cover, depth = self.weather.cloud_cover, self.weather.cloud_optical_depth
        self._light_below = 1.0 - cover + cover * float(self._droplets.transmittance(np.asarray(depth)))
        self._direct_below = (1.0 - cover + cover * math.exp(-0.5 * depth / self._mu_sun)) / self._light_below
        self.has_deck = self.parameters.deck_cover > 0.0 and self.altitude_m > self.parameters.deck_top_m
        self._lit_above = self._lit(self.altitude_m + self.parameters.cloud_height_m)
        self._lit_deck = self._lit(self.parameters.deck_top_m)
        beam = math.exp(-self._haze_depth * float(air_mass(self._sun[2:])[0]))
        through = float(self._droplets.transmittance(np.asarray(self._haze_depth)))
        lit = self._lit(self.altitude_m) if self._haze_depth > 0.0 else 1.0  # without haze J_h is the clear air's J
        self._haze_light = lit * beam, lit * self._mu_sun * (through - beam) * self._light_below

    def _lit(self, height_m: float) -> float:
        """1 while the Sun stands above the horizon of a height over the ground, else 0."""
        dip = dip_sine(self.parameters.earth_radius_m, height_m) if height_m > 0.0 else 0.0
        return 1.0 if self._sun[2] >= -dip else 0.0

    def _clear_mass(self, sine: Array) -> Array:
        """(n,) air mass of clear air, Eq. (2); a ray that would go through the ground counts as one that skims it."""
        mass, level = air_mass(sine), float(air_mass(np.zeros(1))[0])
        r = self.parameters.earth_radius_m + self.altitude_m
        drop_m = r * sine * sine / (1.0 + np.sqrt(np.maximum(1.0 - sine * sine, 0.0)))
        thicker = np.exp(np.minimum(drop_m, self.altitude_m) / self.parameters.aerosol_scale_m)
        return np.where(sine < 0.0, 2.0 * level * thicker - mass, mass)

    def _depth_above(self, d: Array) -> Array:
        """(n,) optical depth straight through the layer where rays (n, 3) cross it, Eq. (3)."""
        p = self.parameters
        if self.weather.cloud_cover <= 0.0:
            return np.zeros(len(d))
        slope = self._slope(d)
        reach = p.cloud_height_m / slope
        noise = self._above.at(d[:, 0] * reach, d[:, 1] * reach, NODE_RAD * reach / np.sqrt(slope))
        return optical_depth(noise, self.weather.cloud_cover, self.weather.cloud_optical_depth)

    def _slope(self, d: Array) -> Array:
        """Return s + w of Eq. (3); the rays that see the layer stay above half of w below level."""
        w = self.parameters.cloud_aspect
        return np.maximum(d[:, 2] + w, 0.5 * w)

    def _surface(self, sine: Array, top_m: float, rise_m: float = 0.0) -> tuple[NDArray[np.bool_], Array, Array]:
        """What rays of (n,) sines do to the sphere of a height, from so much higher than the flight."""
        return meet_sphere(sine, self.parameters.earth_radius_m + top_m, self.altitude_m + rise_m - top_m)

    def _ambient(self) -> float:
        """Mean radiance over a Fibonacci sphere; the cloud's aureole is left out of it, and of the beam."""
        if self.weather.night:
            return self.parameters.night
        k = np.arange(_AMBIENT_DIRECTIONS) + 0.5
        z = 1.0 - 2.0 * k / _AMBIENT_DIRECTIONS
        turn = math.pi * (1.0 + math.sqrt(5.0)) * k
        across = np.sqrt(1.0 - z * z)
        directions = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
        return float(self._radiance(directions, with_aureole=False).mean())
