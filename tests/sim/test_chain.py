"""What follows from the sheets of hose and drogue, and velocities of points of bodies."""

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.sim.hose.chain import DrogueParameters, HoseParameters, velocities_at


def test_velocity_of_a_point_is_that_of_the_reference_and_of_the_turning_about_it():
    rng = np.random.default_rng(1)
    places, spatial, reference = rng.normal(size=(5, 3)), rng.normal(size=(5, 6)), rng.normal(size=3)
    expected = spatial[:, 3:] + np.cross(spatial[:, :3], places - reference)
    np.testing.assert_allclose(velocities_at(places, spatial, reference), expected, rtol=1e-12)


def test_drogues_mass_centre_and_inertia_are_those_of_its_two_parts():
    """As its sheet derives them: a coupling of 14 kg, 0.4 m long, 0.08 m thick, at 0.40 m; a hoop of 6 kg at 0.03 m."""
    drogue = load_parameters("drogue", DrogueParameters)
    coupling, hoop = 14.0, 6.0
    assert coupling + hoop == drogue.mass_kg
    centre = (coupling * 0.40 + hoop * 0.03) / drogue.mass_kg
    assert drogue.centre_of_mass_x_m == pytest.approx(centre, abs=0.002)
    radius = 0.5 * drogue.ring_diameter_m
    along = hoop * radius**2 + 0.5 * coupling * 0.08**2
    across = hoop * (0.5 * radius**2 + (centre - 0.03) ** 2)
    across += coupling * (0.4**2 / 12.0 + 0.08**2 / 4.0 + (0.40 - centre) ** 2)
    np.testing.assert_allclose(drogue.inertia_kg_m2, [along, across, across], rtol=0.05)


def test_links_add_up_to_the_hose():
    hose = load_parameters("hose", HoseParameters, {"links": 7, "length_m": 14.0, "line_density_kg_m": 4.0})
    assert hose.link_length_m == 2.0 and hose.link_mass_kg == 8.0
