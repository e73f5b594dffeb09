"""What the navigation feels of its own tip, beside what the tip does."""

import numpy as np

from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario


def test_in_gusts_the_tip_s_velocity_is_felt_as_it_is_flown():
    """Over a second the tip's velocity changes by 0.3 m/s rms and more; it is felt to 15 % of that, as is each axis."""
    flight = Flight(load_scenario("moderate_gusts", {"camera.sensing": "measurements"}), 5)
    guidance, felt, flown = flight.navigator._guidance, [], []
    step = guidance.step

    def noted(state):
        felt.append(guidance._axes.R_NB @ state.dv_WP_B)
        return step(state)

    guidance.step = noted
    before = flight.truth.v_WP
    for _ in range(4000):
        truth = flight.step().truth
        flown.append(guidance._axes.R_NB @ truth.R_WB.T @ (truth.v_WP - before))
        before = truth.v_WP
    felt, flown = (np.nan_to_num(np.array(v)).cumsum(axis=0)[1500:] for v in (felt, flown))
    change, error = flown[100:] - flown[:-100], (felt - flown)[100:] - (felt - flown)[:-100]
    rms, error_rms = np.sqrt(np.mean(change**2, axis=0)), error.std(axis=0)
    assert (rms[1:] > 0.3).all()
    assert (error_rms < 0.1 * rms.max()).all()
    assert (error_rms[1:] < 0.15 * rms[1:]).all()


def test_perfect_navigation_feels_it_exactly():
    settings = {"navigation.navigator": "truth", "turbulence.intensity": "moderate"}
    flight = Flight(load_scenario("default", settings), 5)
    told, step = [], flight.navigator._guidance.step
    flight.navigator._guidance.step = lambda state: told.append(state) or step(state)
    truths = [flight.step().truth for _ in range(30)]
    assert np.isnan(told[0].dv_WP_B).all()
    for k in range(1, 30):
        np.testing.assert_allclose(truths[k].R_WB @ told[k].dv_WP_B, truths[k].v_WP - truths[k - 1].v_WP, atol=1e-12)
