"""Sheets of the hose and the drogue, and what follows from them: a chain of straight links.

Full trail is the hose drawn out as far as it goes. Link 0 begins at the pod's exit, link i at joint i; the drogue hangs
on the last joint. Axes of a link H: x along it toward the tanker; of the drogue D: origin in the LED ring's centre, x
forward along the hose.

Not modelled: stretch, twist.
Source: the ball-and-rod chain of Ro and Kamman, J. Guidance 33(5), 2010, as in RflySim/RflySimAAR.
"""

from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class HoseParameters:
    """assets/parameters/hose.toml."""

    length_m: float
    links: int
    line_density_kg_m: float
    radius_m: float
    bending_stiffness_n_m2: float
    bending_damping_n_m2_s: float
    normal_drag_coefficient: float
    supercritical_drag_coefficient: float
    crisis_reynolds: float
    crisis_width_ratio: float
    friction_coefficient: float
    reflectance: float

    @property
    def link_length_m(self) -> float:
        """Length of one link [m]."""
        return self.length_m / self.links

    @property
    def link_mass_kg(self) -> float:
        """Mass of one link [kg]."""
        return self.line_density_kg_m * self.link_length_m


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrogueParameters:
    """assets/parameters/drogue.toml. Axes D: origin in the LED ring's centre, x forward along the hose.

    Raises:
        DockairError: no body, or a basket out of order.
    """

    mass_kg: float
    drag_diameter_m: float
    drag_coefficient: float
    canopy_area_ratio: float
    canopy_side_coefficient: float
    drag_centre_x_m: float
    rate_damping_coefficient: float
    centre_of_mass_x_m: float
    inertia_kg_m2: Array
    hose_joint_x_m: float
    hinge_damping_n_m_s: float
    ring_diameter_m: float
    rim_x_m: float
    rim_tube_radius_m: float
    ribs: int
    rib_radius_m: float
    throat_x_m: float
    canopy_diameter_m: float
    canopy_length_m: float
    led_housing_radius_m: float
    led_housing_gap_m: float
    led_housing_reflectance: float
    friction: float
    contact_time_constant_s: float
    reflectance: float
    canopy_reflectance: float

    def __post_init__(self) -> None:
        """Refuse what is no body, and a basket out of order: LEDs, then the rim, then the throat."""
        least, middle, most = np.sort(self.inertia_kg_m2)
        if not least + middle >= most:
            where, expected = "drogue.inertia_kg_m2", "the inertia of a body, no moment above the sum of the others"
            raise DockairError(where, expected=expected, got=np.asarray(self.inertia_kg_m2).tolist())
        if not self.rim_tube_radius_m < self.rim_x_m:
            expected = f"more than drogue.rim_tube_radius_m = {self.rim_tube_radius_m}, or the rim hides the LEDs"
            raise DockairError("drogue.rim_x_m", expected=expected, got=self.rim_x_m)
        if not self.led_housing_gap_m < self.rim_x_m:
            expected = f"less than drogue.rim_x_m = {self.rim_x_m}, to which the housing reaches from there"
            raise DockairError("drogue.led_housing_gap_m", expected=expected, got=self.led_housing_gap_m)
        if not self.rim_x_m < self.throat_x_m:
            expected = f"more than drogue.rim_x_m = {self.rim_x_m}"
            raise DockairError("drogue.throat_x_m", expected=expected, got=self.throat_x_m)

    @property
    def drag_area_m2(self) -> float:
        """Reference area S of the drag coefficient [m^2]."""
        return 0.25 * np.pi * self.drag_diameter_m**2

    @property
    def canopy_area_m2(self) -> float:
        """Fabric of the canopy [m^2], reference area of the side force."""
        return self.canopy_area_ratio * self.drag_area_m2


@njit(cache=True)
def velocities_at(places: Array, spatial: Array, reference: Array) -> Array:
    """(n, 3) velocities of points fixed in n bodies.

    Args:
        places: (n, 3) the points in W [m].
        spatial: (n, 6) angular velocity and velocity of each body's material at `reference`, in W.
        reference: (3,) point of W.
    """
    v = np.empty((places.shape[0], 3))
    for i in range(places.shape[0]):
        x, y, z = places[i, 0] - reference[0], places[i, 1] - reference[1], places[i, 2] - reference[2]
        v[i, 0] = spatial[i, 3] + spatial[i, 1] * z - spatial[i, 2] * y
        v[i, 1] = spatial[i, 4] + spatial[i, 2] * x - spatial[i, 0] * z
        v[i, 2] = spatial[i, 5] + spatial[i, 0] * y - spatial[i, 1] * x
    return v
