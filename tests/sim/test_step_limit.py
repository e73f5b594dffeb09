"""Which step is too long is said before the world flies, and by whose fault."""

from dataclasses import replace

import numpy as np
import pytest

import dockair.sim.world
from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.hose.reel import Reel, ReelParameters
from dockair.sim.step_limit import (
    lowest_rate_hz,
    lowest_rate_in_air_hz,
    lowest_rate_of_lock_hz,
    lowest_rate_of_reel_hz,
)

SOFT_TUBE = {"guide_stiffness_n_m2": 12000.0, "guide_damping_ratio": 0.1}
SOFT_LOCK = {"lock_stiffness_n_m": 20000.0, "lock_damping_n_s_m": 0.0}


def test_step_longer_than_half_a_contact_is_refused_with_its_key(make_world):
    with pytest.raises(DockairError, match=r"rates\.physics_hz: expected at least 250 Hz.*contact_time_constant_s"):
        make_world(rate_hz=200, reel=SOFT_TUBE)
    make_world(rate_hz=250, reel=SOFT_TUBE)


@pytest.mark.parametrize(
    ("name", "key", "shortest_s", "lowest_hz"),
    [("coupling", "latch_time_constant_s", 0.01, 200), ("reel", "stop_time_constant_s", 0.004, 500)],
)
def test_step_longer_than_half_the_latchs_or_the_stops_time_constant_is_refused_with_its_key(
    make_world, name, key, shortest_s, lowest_hz
):
    """With the least of the sheet's range, all else being soft."""
    soft = {"reel": SOFT_TUBE | SOFT_LOCK, "drogue": {"contact_time_constant_s": 0.02}}
    soft[name] = soft.get(name, {}) | {key: shortest_s}
    words = rf"expected at least {lowest_hz} Hz, because of parameters\.{name}\.{key}"
    with pytest.raises(DockairError, match=words):
        make_world(rate_hz=lowest_hz - 1, **soft)
    make_world(rate_hz=lowest_hz, **soft)


def _needed_hz(world):
    return lowest_rate_hz(world.model, world.parameters, world.rest.root_tension_n)


def test_step_too_long_for_the_tube_is_refused_with_the_hose(make_world):
    stiff = {"reel": {"guide_stiffness_n_m2": 360000.0}, "hose": {"links": 40}}
    with pytest.raises(DockairError, match=r"rates\.physics_hz: expected at least \d+ Hz, because of hose and reel"):
        make_world(rate_hz=1000, **stiff)


HARD_BRAKE = {"brake_force_n": 20000.0, "speed_band_m_s": 0.1, "drum_mass_kg": 10.0}


def test_step_too_long_for_the_reels_brake_is_refused_with_its_keys(make_world):
    keys = r"parameters\.reel\.brake_force_n over speed_band_m_s"
    with pytest.raises(DockairError, match=rf"rates\.physics_hz: expected at least 1094 Hz, because of {keys}"):
        make_world(rate_hz=1000, reel=HARD_BRAKE)


@pytest.mark.parametrize(("share", "settles"), [(1.02, True), (0.98, False)])
def test_below_the_brakes_rate_a_hose_that_runs_out_chatters_and_above_it_does_not(make_world, share, settles):
    """One mass, pulled out by twice the set-point, under the reel's own law."""
    world = make_world(rate_hz=1200, reel=HARD_BRAKE)
    p, sheet = world.parameters, load_parameters("reel", ReelParameters, HARD_BRAKE)
    step_s, rate_m_s, last = 1.0 / (share * lowest_rate_of_reel_hz(p, sheet.brake_force_n)), 0.0, []
    moved_kg = sheet.drum_mass_kg + p.hose.length_m * p.hose.line_density_kg_m + p.drogue.mass_kg
    reel = Reel(sheet, static_root_tension_n=1918.0, static_pull_n=1876.0, set_point_n=1726.0, step_s=step_s)
    for _ in range(4000):
        rate_m_s += step_s * (reel.step(1726.0, 6.0, rate_m_s) - 3452.0) / moved_kg
        last.append(rate_m_s)
    assert (np.ptp(last[-200:]) < 1e-6) == settles


QUICK_MOTOR = {"tension_gain": 2.0, "speed_band_m_s": 0.1, "drum_mass_kg": 10.0, "drum_damping_n_s_m": 0.0}


def test_step_too_long_for_the_reels_motor_is_refused_with_its_keys(make_world):
    """Which pulls a slack hose with (1 + k) f T, T being what the hose bears at rest."""
    keys = r"parameters\.reel\.tension_gain over speed_band_m_s"
    heavy_drag = {"drag_diameter_m": 0.81, "drag_coefficient": 1.0}
    flown = {"airspeed_m_s": 250.0, "altitude_m": 0.0, "reel": QUICK_MOTOR, "drogue": heavy_drag}
    world = make_world(rate_hz=4000, **flown)
    p, reel = world.parameters, world.parameters.reel
    slack_n = (1.0 + 2.0) * reel.set_point_fraction * world.rest.root_tension_n
    lowest_hz = slack_n / 0.1 / (2.0 * (10.0 + p.hose.length_m * p.hose.line_density_kg_m + p.drogue.mass_kg))
    words = rf"rates\.physics_hz: expected at least {np.ceil(lowest_hz):.0f} Hz, because of {keys}"
    with pytest.raises(DockairError, match=words):
        make_world(rate_hz=1000, **flown)


@pytest.mark.parametrize(("share", "settles"), [(1.02, True), (0.98, False)])
def test_below_the_motors_rate_a_slack_hose_comes_in_chattering_and_above_it_does_not(make_world, share, settles):
    """One mass whose hose bears nothing, braked by the set-point's force, drawn in as fast as the reel takes it up."""
    world = make_world(rate_hz=1200, reel=QUICK_MOTOR)
    p, sheet = world.parameters, load_parameters("reel", ReelParameters, QUICK_MOTOR)
    moved_kg = sheet.drum_mass_kg + p.hose.length_m * p.hose.line_density_kg_m + p.drogue.mass_kg
    step_s = 1.0 / (share * lowest_rate_of_reel_hz(p, (1.0 + sheet.tension_gain) * 1726.0))
    reel = Reel(sheet, static_root_tension_n=1918.0, static_pull_n=1876.0, set_point_n=1726.0, step_s=step_s)
    rates_m_s = [0.95 * sheet.take_up_speed_m_s]
    for _ in range(4000):
        rates_m_s.append(rates_m_s[-1] + step_s * (reel.step(0.0, 6.0, rates_m_s[-1]) - 1726.0) / moved_kg)
    assert (np.ptp(rates_m_s[-200:]) < 1e-6) == settles


HARD_LOCK = {"lock_stiffness_n_m": 300000.0, "lock_damping_n_s_m": 10000.0}
LONG_LINKS = {"reel": SOFT_TUBE | HARD_LOCK, "hose": {"links": 8}}


def test_step_too_long_for_a_dead_reels_lock_is_refused_with_its_keys(make_world):
    keys = r"parameters\.reel\.lock_damping_n_s_m and lock_stiffness_n_m"
    with pytest.raises(DockairError, match=rf"rates\.physics_hz: expected at least 666 Hz, because of {keys}"):
        make_world(rate_hz=665, **LONG_LINKS)
    make_world(rate_hz=666, **LONG_LINKS)


@pytest.mark.parametrize(("share", "settles"), [(1.02, True), (0.98, False)])
@pytest.mark.parametrize("lock", [HARD_LOCK, HARD_LOCK | {"lock_damping_n_s_m": 1.0}])
def test_below_the_locks_rate_one_link_on_it_shakes_itself_apart_and_above_it_rests(make_world, lock, share, settles):
    p = make_world(rate_hz=3000, reel=lock).parameters
    step_s, place_m, rate_m_s = 1.0 / (share * lowest_rate_of_lock_hz(p)), 6.0, 0.1
    reel = Reel(p.reel, static_root_tension_n=1918.0, static_pull_n=1876.0, set_point_n=1726.0, step_s=step_s)
    reel.step(0.0, place_m, 0.0, locked=True)
    for _ in range(2000):
        rate_m_s += step_s * reel.step(0.0, place_m, rate_m_s, locked=True) / p.hose.link_mass_kg
        place_m += step_s * rate_m_s
        if abs(rate_m_s) > 1e6:
            break
    assert (abs(rate_m_s) < 0.1) == settles


@pytest.mark.parametrize(("share", "stays"), [(1.0, True), (0.4, False)])
def test_hose_pushed_in_on_a_dead_reel_folds_at_the_lowest_rate_and_diverges_well_below(
    make_world, monkeypatch, share, stays
):
    """A receiver that latches at 1.6 m/s and then slows down: it folds a hose that cannot be taken up."""
    monkeypatch.setattr(dockair.sim.world, "check_step", lambda *_: None)
    rate_hz = int(np.ceil(share * lowest_rate_of_lock_hz(make_world(**LONG_LINKS).parameters)))
    world = make_world(p_PD_B=(0.1, 0.0, 0.0), rate_hz=rate_hz, reel_locked=lambda _: True, **LONG_LINKS)
    finished = True
    try:
        for tick in range(3 * rate_hz):
            forward_m_s = 1.6 - 0.24 * max(tick / rate_hz - 0.2, 0.0)
            world.step(ReceiverCommand(velocity_m_s=np.array([forward_m_s, 0.0, 0.0])))
    except DockairError:
        finished = False
    assert finished == stays


WIDE_AND_LIGHT = {"rate_damping_coefficient": 20.0, "drag_diameter_m": 0.81, "inertia_kg_m2": [0.05, 0.05, 0.05]}


def test_step_too_long_for_the_air_about_the_drogue_is_refused_with_its_keys(make_world):
    keys = r"parameters\.drogue\.rate_damping_coefficient and inertia_kg_m2"
    with pytest.raises(DockairError, match=rf"rates\.physics_hz: expected at least 1773 Hz, because of {keys}"):
        make_world(rate_hz=1000, drogue=WIDE_AND_LIGHT)


def test_the_airs_rate_goes_by_density_times_airspeed(make_world):
    """Eq. (5): the dampings are those of loads with 1/2 rho V."""
    world = make_world()
    p = world.parameters
    flown = replace(p, airspeed_m_s=0.7 * p.airspeed_m_s, air=replace(p.air, density_kg_m3=1.5 * p.air.density_kg_m3))
    expected = 0.7 * 1.5 * lowest_rate_in_air_hz(world.model, p)
    assert lowest_rate_in_air_hz(world.model, flown) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("share", "stays"), [(1.05, True), (0.95, False)])
def test_below_the_airs_rate_a_drogue_shakes_itself_apart_and_above_it_rests(make_world, monkeypatch, share, stays):
    monkeypatch.setattr(dockair.sim.world, "check_step", lambda *_: None)
    world = make_world(drogue=WIDE_AND_LIGHT)
    rate_hz = round(share * lowest_rate_in_air_hz(world.model, world.parameters))
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), rate_hz=rate_hz, drogue=WIDE_AND_LIGHT)
    try:
        turning_rad_s = [np.abs(world.step(ReceiverCommand()).w_WD_D).max() for _ in range(rate_hz)]
    except DockairError:
        turning_rad_s = [np.inf]
    assert (turning_rad_s[-1] < 1e-3) == stays


def test_bound_grows_with_stiffness_with_damping_and_with_the_number_of_links(make_world):
    plain = _needed_hz(make_world())
    finer = (
        {"hose": {"links": 30}},
        {"hose": {"bending_stiffness_n_m2": 100.0}},
        {"reel": {"guide_damping_ratio": 0.51}},
    )
    assert all(_needed_hz(make_world(**sheets)) > plain for sheets in finer)


def test_bound_is_the_rate_at_which_an_endless_chain_in_the_tube_just_stays_bounded(make_world):
    """Joints up and down by turns, energies written down anew: Eq. (1) is the edge of the step's own eigenvalues."""
    world = make_world(hose={"bending_stiffness_n_m2": 0.0})
    hose, reel, rate_hz = world.parameters.hose, world.parameters.reel, _needed_hz(world)
    m, length, z = hose.link_mass_kg, hose.link_length_m, reel.guide_damping_ratio
    k = reel.guide_stiffness_n_m2 * length
    mass = m * length**2 / 12.0 * (2.0 / length) ** 2  # the links turn by 2 y / l, their middles stand
    stiffness = k + k * length**2 * (2.0 / length) ** 2 + 4.0 * world.rest.root_tension_n / length
    turning = 2.0 * z * np.sqrt(k * length**2 * m * length**2 / 3.0)
    damping = 2.0 * z * np.sqrt(k * m) + turning * (2.0 / length) ** 2

    def growth(step_s):
        velocity_row = [1.0 - step_s * damping / mass, -step_s * stiffness / mass]
        step = np.array([velocity_row, [step_s * velocity_row[0], 1.0 + step_s * velocity_row[1]]])
        return np.abs(np.linalg.eigvals(step)).max()

    assert growth(1.0 / (1.002 * rate_hz)) < 1.0 < growth(1.0 / (0.998 * rate_hz))


@pytest.mark.parametrize(("share", "stays"), [(1.0, True), (0.8, False)])
def test_hose_wound_in_stays_where_it_is_at_the_lowest_rate_and_diverges_well_below(
    make_world, wind_in, monkeypatch, share, stays
):
    """All of the reel's range in the tube: seven links, which need nine tenths of what an endless chain would."""
    monkeypatch.setattr(dockair.sim.world, "check_step", lambda *_: None)
    rate_hz = int(np.ceil(share * _needed_hz(make_world())))
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), rate_hz=rate_hz, reel_locked=lambda time_s: True)
    wind_in(world, world.parameters.reel.range_m)
    inside_m = []
    try:
        for _ in range(rate_hz):
            truth = world.step(ReceiverCommand())
            inside_m.append(np.abs(truth.p_WH[:7, 2]).max())
    except DockairError:
        inside_m.append(np.inf)
    assert (max(inside_m) < 0.01) == stays
