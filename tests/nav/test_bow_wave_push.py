"""The push that guidance anticipates: its shape, its rate against differences, and where it ends."""

import numpy as np
import pytest

from dockair.nav.guidance.bow_wave_push import BowWavePush

PUSH = BowWavePush()


def _at(x):
    return np.array(PUSH.at_contact_m) / (1.0 + x / PUSH.reach_m) ** 2


def test_what_is_still_to_come_is_the_difference_of_the_pushes():
    way, _ = PUSH.ahead(2.0, 1.2)
    np.testing.assert_allclose(way, _at(2.0 - 0.6) - _at(2.0), rtol=1e-12)


def test_its_rate_is_the_push_s_own_along_the_way():
    step, later = 1e-6, 2.0 - 1.2 * PUSH.lead_s
    here, there = ((_at(x - 1.2 * step) - _at(x)) / step for x in (2.0, later))
    np.testing.assert_allclose(PUSH.ahead(2.0, 1.2)[1], there - here, rtol=1e-5)


def test_nothing_is_added_at_contact_nor_while_backing_off():
    for distance, closing in ((0.0, 1.2), (-0.1, 1.2), (2.0, 0.0), (2.0, -1.0)):
        way, rate = PUSH.ahead(distance, closing)
        assert (way == 0.0).all() and (rate == 0.0).all()
    assert np.abs(PUSH.ahead(1e-9, 1.2)[0]).max() < 1e-9


def test_the_whole_push_is_anticipated_once_contact_lies_within_the_lead():
    way, _ = PUSH.ahead(1.2 * PUSH.lead_s, 1.2)
    np.testing.assert_allclose(_at(1.2 * PUSH.lead_s) + way, PUSH.at_contact_m, rtol=1e-12)


@pytest.mark.parametrize(("distance_m", "measured_m"), [(1.0, -0.042), (2.0, -0.019), (3.0, -0.011)])
def test_it_is_the_measured_push_to_a_centimetre(distance_m, measured_m):
    assert _at(distance_m)[0] == pytest.approx(measured_m, abs=0.01)
