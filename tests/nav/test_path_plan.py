"""The plan across: against the quadratic programme solved by another program, and flown."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from dockair.nav.guidance.path_plan import PathPlan, PlanSettings

SETTINGS = PlanSettings()
ACCELERATION, JERK, STEP_S = 3.0, 12.0, 0.01
TIMES = SETTINGS.node_s * np.arange(1, SETTINGS.nodes + 1)


def _places(x, jerks):
    """Places and accelerations at the nodes, integrated jerk by jerk."""
    (y, v, a), h, places, accelerations = x, SETTINGS.node_s, [], []
    for jerk in jerks:
        y, v, a = y + v * h + a * h**2 / 2 + jerk * h**3 / 6, v + a * h + jerk * h**2 / 2, a + jerk * h
        places.append(y)
        accelerations.append(a)
    return np.array(places), np.array(accelerations)


def _exact(x, target, weights, price, share=1.0):
    """First jerk of the programme by sequential quadratic programming on the integrated path.

    Of both limits only a share may be used, at each node another.
    """
    share = share * np.ones(SETTINGS.nodes)

    def cost(z):
        return weights @ (_places(x, JERK * z)[0] - target) ** 2 + price * z @ z

    room = {"type": "ineq", "fun": lambda z: share - np.abs(_places(x, JERK * z)[1]) / ACCELERATION}
    start = np.zeros(SETTINGS.nodes)
    bounds = list(zip(-share, share, strict=True))
    options = {"maxiter": 400, "ftol": 1e-9}
    found = minimize(cost, start, bounds=bounds, constraints=[room], options=options)
    return JERK * found.x[0]


def _settled(plan, x, target, to_contact_s=None, calm=False):
    for _ in range(60):
        jerk = plan.jerk_m_s3(np.asarray(x), target, to_contact_s, calm=calm)
    return jerk


@pytest.mark.parametrize(
    ("x", "size", "phase"),
    [
        ((0.0, 0.0, 0.0), 0.05, 0.3),
        ((0.1, -0.2, 1.0), 0.3, 2.0),
        ((0.0, 0.5, -2.5), 0.6, 4.0),
        ((0.2, 0.0, 2.9), 1.0, 1.0),
    ],
)
def test_the_first_jerk_is_that_of_the_quadratic_programme(x, size, phase):
    target = size * np.sin(2.5 * TIMES + phase)
    expected = _exact(x, target, np.ones(SETTINGS.nodes), SETTINGS.jerk_price_m2)
    assert _settled(PathPlan(SETTINGS, ACCELERATION, JERK), x, target) == pytest.approx(expected, abs=0.02 * JERK)


@pytest.mark.parametrize(
    ("x", "size", "phase", "to_contact_s", "calm"),
    [
        ((0.0, 0.0, 0.0), 1.5, 1.0, 0.9, False),  # with all of the acceleration 10.8 m/s^3 in place of 3.2
        ((0.0, 0.0, 0.0), 1.0, 1.2, 0.9, False),
        ((0.0, 0.0, 0.0), 0.1, 0.6, 0.48, False),
        ((0.0, 0.0, 0.0), 1.0, 0.3, 1.9, False),  # out of sight: what counts on the way, and little else
        ((0.0, 0.2, 0.5), 0.6, 0.3, 1.1, True),
    ],
)
def test_to_contact_it_is_that_of_the_programme_about_that_moment_with_half_of_later_limits_kept_back(
    x, size, phase, to_contact_s, calm
):
    """At that price, too, that a swing has which is only waited for."""
    s, target = SETTINGS, size * np.sin(2.5 * TIMES + phase)
    after_s = TIMES - (to_contact_s + s.half_way_s)
    near = np.where(after_s < 2.0 * s.contact_s, np.exp(-((after_s / s.contact_s) ** 2) / 2.0), 0.0)
    share = 1.0 - s.kept_back * np.minimum((TIMES - TIMES[0]) / s.kept_back_s, 1.0)
    price = s.calm_price_s6 * JERK**2 if calm else s.jerk_price_m2
    expected = _exact(x, target, s.on_the_way + s.at_contact * near, price, share)
    plan = PathPlan(s, ACCELERATION, JERK)
    assert _settled(plan, x, target, to_contact_s, calm) == pytest.approx(expected, abs=0.003 * JERK)


def test_with_room_to_spare_it_is_the_least_squares_solution():
    x, target = np.array([0.0, 0.02, 0.05]), 0.02 * np.sin(2.0 * TIMES)
    basis = np.column_stack([_places((0, 0, 0), JERK * unit)[0] for unit in np.eye(SETTINGS.nodes)])
    free = _places(x, np.zeros(SETTINGS.nodes))[0]
    rows = np.vstack([basis, np.sqrt(SETTINGS.jerk_price_m2) * np.eye(SETTINGS.nodes)])
    z = np.linalg.lstsq(rows, np.append(target - free, np.zeros(SETTINGS.nodes)), rcond=None)[0]
    assert np.abs(z).max() < 0.5
    assert _settled(PathPlan(SETTINGS, ACCELERATION, JERK), x, target) == pytest.approx(JERK * z[0], rel=1e-6)


def _flown(drogue, seconds, contact_s=None, plan_settings=SETTINGS):
    """Fly a plan against a drogue that is known ahead; the errors, accelerations and jerks, tick by tick."""
    plan, (y, v, a), out = PathPlan(plan_settings, ACCELERATION, JERK), (drogue(0.0), 0.0, 0.0), []
    for i in range(round(seconds / STEP_S)):
        t = i * STEP_S
        to_contact_s = None if contact_s is None else contact_s - t
        jerk = plan.jerk_m_s3(np.array([0.0, v, a]), drogue(t + TIMES) - y, to_contact_s)
        y, v, a = y + v * STEP_S + a * STEP_S**2 / 2, v + a * STEP_S + jerk * STEP_S**2 / 2, a + jerk * STEP_S
        out.append((drogue(t + STEP_S) - y, a, jerk))
    return np.array(out)


def test_beginning_at_the_last_ticks_solution_a_jerk_is_two_per_cent_of_its_limit_off_the_exact_one_on_average():
    """On the way to meet a swing beyond the limits, against one that is given twenty ticks for each."""
    plan, exact, (y, v, a), off = *(PathPlan(SETTINGS, ACCELERATION, JERK) for _ in range(2)), (0.0, 0.0, 0.0), []
    for i in range(400):
        x, target = np.array([0.0, v, a]), 0.6 * np.sin(2.7 * (i * STEP_S + TIMES)) - y
        jerk = plan.jerk_m_s3(x, target, 4.0 - i * STEP_S)
        if i % 5 == 0:
            jerks = [exact.jerk_m_s3(x, target, 4.0 - i * STEP_S) for _ in range(20)]
            off.append(abs(jerk - jerks[-1]) / JERK)
        y, v, a = y + v * STEP_S + a * STEP_S**2 / 2, v + a * STEP_S + jerk * STEP_S**2 / 2, a + jerk * STEP_S
    assert np.mean(off) < 0.02


def test_a_swing_within_the_limits_is_followed_to_a_centimetre():
    errors = _flown(lambda t: 0.3 * np.sin(2.0 * t), 12.0)[300:, 0]  # 1.2 m/s^2, 2.4 m/s^3
    assert np.abs(errors).max() < 0.01


def test_a_swing_beyond_the_limits_is_met_at_the_moment_of_contact():
    def swing(t):
        return 0.6 * np.sin(2.7 * t)  # 4.4 m/s^2 of 3 that can be flown

    followed = np.abs(_flown(swing, 12.0)[:, 0])
    misses, meant = [], []
    for contact_s in np.arange(6.0, 8.3, 0.29):
        misses.append(abs(_flown(swing, contact_s, contact_s)[-1, 0]))
        meant.append(followed[round(contact_s / STEP_S) - 1])
    assert np.sqrt(np.mean(np.square(misses))) < 0.4 * np.sqrt(np.mean(np.square(meant)))


def test_it_is_met_half_way_to_the_coupling_at_the_ring_s_cost():
    """Rms over eight moments of a swing beyond the limits, at the ring and 0.1 s later."""
    at_ring, half_way = [], []
    for half_way_s in (0.0, 0.1):
        settings_, errors = replace(SETTINGS, half_way_s=half_way_s), []
        for contact_s in np.arange(6.0, 8.3, 0.29):
            flown = _flown(lambda t: 0.6 * np.sin(2.7 * t), contact_s + 0.1, contact_s, settings_)
            errors.append(flown[[-11, -1], 0])
        for found, rms in zip((at_ring, half_way), np.sqrt(np.mean(np.square(errors), axis=0)), strict=True):
            found.append(rms)
    assert at_ring[0] < 0.6 * at_ring[1]
    assert half_way[1] < 0.7 * half_way[0]


@pytest.mark.parametrize("to_contact_s", [0.35, 0.5])
def test_what_the_drogue_does_after_contact_does_not_matter(to_contact_s):
    """From two widths after the middle of contact on; at 0.35 s that is just before a node."""
    x, target, plans = np.array([0.0, 0.1, 0.5]), 0.2 * np.sin(2.5 * TIMES), []
    for later in (0.0, 0.3):
        over_s = to_contact_s + SETTINGS.half_way_s + 2.0 * SETTINGS.contact_s
        moved = np.where(TIMES > over_s, target + later, target)
        plan = PathPlan(replace(SETTINGS, on_the_way=0.0), ACCELERATION, JERK)
        plans.append(_settled(plan, x, moved, to_contact_s=to_contact_s))
    assert plans[0] == plans[1]


def test_a_contact_that_is_overdue_is_met_at_the_first_node():
    x, target = np.array([0.0, 0.1, 0.5]), 0.2 * np.sin(2.5 * TIMES)
    now, overdue = (_settled(PathPlan(SETTINGS, ACCELERATION, JERK), x, target, t) for t in (0.0, -1.0))
    assert now == overdue


def test_waiting_calmly_is_less_hasty():
    x, target = np.zeros(3), np.full(SETTINGS.nodes, 0.2)
    hasty, calm = (_settled(PathPlan(SETTINGS, ACCELERATION, JERK), x, target, calm=calm) for calm in (False, True))
    assert 0.0 < calm < 0.5 * hasty


@settings(max_examples=60, deadline=None)
@given(
    x=st.tuples(st.floats(-2, 2), st.floats(-3, 3), st.floats(-ACCELERATION, ACCELERATION)),
    size=st.floats(0, 3),
    rate=st.floats(0.5, 6),
    to_contact_s=st.one_of(st.none(), st.floats(-1, 3)),
)
def test_no_jerk_is_beyond_the_limit_and_none_is_lost_to_nan(x, size, rate, to_contact_s):
    plan = PathPlan(SETTINGS, ACCELERATION, JERK)
    for _ in range(3):
        assert abs(plan.jerk_m_s3(np.array(x), size * np.sin(rate * TIMES), to_contact_s)) <= JERK


def test_waiting_calmly_goes_to_a_drogue_at_rest_without_haste():
    plan, (y, v, a), places, accelerations = PathPlan(SETTINGS, ACCELERATION, JERK), (0.0, 0.0, 0.0), [], []
    for _ in range(1500):
        off = np.full(SETTINGS.nodes, min(1.0 - y, SETTINGS.error_max_m))
        jerk = plan.jerk_m_s3(np.array([0.0, v, a]), off, None, calm=True)
        y, v, a = y + v * STEP_S, v + a * STEP_S, a + jerk * STEP_S
        places.append(y)
        accelerations.append(abs(a))
    assert max(accelerations) < 0.25 * ACCELERATION
    assert max(places) < 1.2 and np.abs(np.array(places[800:]) - 1.0).max() < 0.05
