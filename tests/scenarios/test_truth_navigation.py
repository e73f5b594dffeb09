"""Perfect navigation: what it hands to the guidance is the truth, in the guidance's terms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dockair.rotations import exp
from dockair.scenarios.assembly.parts import build
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.truth_navigation import TruthNavigator


@cache
def parts():
    return build(load_scenario("truth_navigation"), 0)


def turning_truth():
    return replace(
        parts().world.truth,
        R_WB=exp(np.array([0.1, -0.2, 0.3])),
        w_WB_B=np.array([0.1, -0.3, 0.2]),
        p_WP=np.array([-20.0, 1.0, -3.0]),
        v_WP=np.array([1.0, 0.2, -0.1]),
        R_WD=exp(np.array([0.0, -0.1, 0.05])),
        p_WD=np.array([-15.0, 0.5, -2.5]),
        v_WD=np.array([-0.2, 0.3, 0.4]),
    )


def handed_over(truth, monkeypatch):
    navigator, seen = parts().navigator, []
    assert isinstance(navigator, TruthNavigator)
    guide = navigator._guidance.step
    monkeypatch.setattr(navigator._guidance, "step", lambda state: seen.append(state) or guide(state))
    navigator.truth = truth
    return navigator.step((), None), seen[0]


def test_the_rate_told_is_that_of_the_place_told_in_axes_that_turn(monkeypatch):
    """Tip and drogue moved on by their velocities, the receiver turned by its rate: a difference over 1 us."""
    h, now = 1e-6, turning_truth()
    later = replace(
        now, R_WB=now.R_WB @ exp(h * now.w_WB_B), p_WP=now.p_WP + h * now.v_WP, p_WD=now.p_WD + h * now.v_WD
    )
    _, state = handed_over(now, monkeypatch)
    np.testing.assert_allclose(state.p_PD_B, now.R_WB.T @ (now.p_WD - now.p_WP), atol=1e-12)
    np.testing.assert_allclose(state.rate_PD_B, (later.p_PD_B - now.p_PD_B) / h, atol=1e-6)


def test_the_coupling_lies_its_depth_along_the_drogues_axis(monkeypatch):
    truth = turning_truth()
    _, state = handed_over(truth, monkeypatch)
    coupling_W = truth.p_WD + truth.R_WD @ [parts().sheets.coupling_depth_m, 0.0, 0.0]
    np.testing.assert_allclose(state.p_PK_B, truth.R_WB.T @ (coupling_W - truth.p_WP), atol=1e-12)


def test_the_solution_is_marked_and_certain_and_has_seen_no_frame(monkeypatch):
    truth = turning_truth()
    solution, state = handed_over(truth, monkeypatch)
    assert state.usable and state.contact_usable and state.sigma_lateral_m == 0.0
    assert solution.valid and solution.status == "truth" and solution.time_stamp_s == truth.time_s
    assert solution.contact_usable and solution.phase == parts().navigator._guidance.phase.value
    assert not np.isfinite(solution.led_pixels_px).any() and len(solution.candidates_px) == 0
    shared = (solution.covariance, solution.led_pixels_px, solution.candidates_px)  # with every other solution
    assert not any(array.flags.writeable for array in shared)
    assert not solution.covariance.any() and solution.window is None and np.isnan(solution.frame_time_stamp_s)
    np.testing.assert_allclose(solution.v_PD_B, truth.R_WB.T @ (truth.v_WD - truth.v_WP), atol=1e-12)
    np.testing.assert_allclose(solution.R_BD, truth.R_WB.T @ truth.R_WD, atol=1e-12)


def test_what_the_tips_velocity_changed_by_is_told_in_the_receivers_axes_and_unknown_at_first(monkeypatch):
    first = turning_truth()
    second = replace(first, v_WP=first.v_WP + np.array([0.03, -0.02, 0.01]))
    monkeypatch.setattr(parts().navigator, "_v_WP", None)
    _, state = handed_over(first, monkeypatch)
    assert np.isnan(state.dv_WP_B).all()
    monkeypatch.undo()
    parts().navigator._v_WP = first.v_WP
    _, state = handed_over(second, monkeypatch)
    np.testing.assert_allclose(state.dv_WP_B, first.R_WB.T @ [0.03, -0.02, 0.01], atol=1e-15)
    _, state = handed_over(second, monkeypatch)
    np.testing.assert_array_equal(state.dv_WP_B, np.zeros(3))


def test_what_is_announced_and_shown_reaches_guidance_and_its_reason_the_solution(monkeypatch):
    navigator, heard = parts().navigator, []
    for name in ("announce", "signal"):
        monkeypatch.setattr(navigator._guidance, name, lambda message, name=name: heard.append((name, message)))
    navigator.announce("a turn")
    navigator.signal("red")
    assert heard == [("announce", "a turn"), ("signal", "red")]
    solution, _ = handed_over(turning_truth(), monkeypatch)
    assert solution.phase_reason == navigator._guidance.phase_reason
    guide = navigator._guidance.step
    monkeypatch.setattr(
        navigator._guidance,
        "step",
        lambda state: (guide(state), setattr(navigator._guidance, "phase_reason", "steady"))[0],
    )
    assert navigator.step((), None).phase_reason == "steady"


def test_without_a_truth_it_does_not_navigate():
    navigator = build(load_scenario("truth_navigation"), 0).navigator
    with pytest.raises(AssertionError, match="the loop sets the truth"):
        navigator.step((), None)
