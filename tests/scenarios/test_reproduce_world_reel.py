"""The reproductions of contact, reel and hose whip: what they measure, on short runs and on runs made by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from dockair.parameters import load_parameters
from dockair.scenarios.judgement.referee import Outcome
from dockair.scenarios.reproduce.world import contact as world_contact
from dockair.scenarios.reproduce.world import reel as world_reel
from dockair.scenarios.reproduce.world import whip as world_whip
from dockair.sim.hose.reel import ReelParameters

REEL = load_parameters("reel", ReelParameters)


def test_bow_is_the_height_of_a_triangle_over_the_chord_and_leaves_out_what_lies_in_the_pod():
    along, across = np.array([-12.0, 0.0, -5.0]) / 13.0, np.array([5.0, 0.0, -12.0]) / 13.0
    outside = [np.zeros(3), 6.5 * along + 0.8 * across, 13.0 * along]
    assert world_whip.bow(np.array(outside)) == pytest.approx(0.8)
    assert world_whip.bow(np.array([[3.0, 0.0, 0.0], [1.5, 0.0, 0.0], *outside])) == pytest.approx(0.8)


def _made_by_hand(*, peak=1.0, bow_m=0.2, held=True):
    tension = np.full(100, 1900.0)
    tension[40] = 1900.0 * peak
    shape = np.array([[0.0, 0.0, 0.0], [-5.0, 0.0, 0.2], [-10.0, 0.0, 0.0]])
    bowed = shape * [1.0, 1.0, bow_m / 0.2]
    return world_whip.Engagement(
        speed_m_s=1.2,
        dead=False,
        static_n=1900.0,
        tension_n=tension,
        coupling_n=np.zeros(100),
        wound_in_m=np.zeros(100),
        latched=np.arange(100) < (100 if held else 30),
        p_WH=np.array([shape, bowed]),
    )


@pytest.mark.parametrize(
    ("run", "whips"),
    [({"peak": 1.49}, False), ({"peak": 1.51}, True), ({"bow_m": 0.69}, False), ({"bow_m": 0.71}, True)],
)
def test_a_hose_whips_by_tension_or_by_bow(run, whips):
    assert _made_by_hand(**run).whips is whips


def test_moment_at_which_the_coupling_lets_go_is_in_the_row_only_if_it_does():
    held, lost = (world_whip._row(_made_by_hand(held=held))["ours"] for held in (True, False))
    assert "let_go_s" not in held and lost["let_go_s"] == pytest.approx(0.030)
    json.dumps([held, lost], allow_nan=False)


def test_numbers_on_an_axis_of_the_hoses_shapes_stand_apart(tmp_path, monkeypatch):
    run, drawn = _made_by_hand(), []
    run = replace(run, p_WH=np.repeat(run.p_WH, 200, axis=0))
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: drawn.append(figure))
    speeds = world_whip.SPEEDS_M_S
    world_whip._draw([replace(run, speed_m_s=v, dead=dead) for v in speeds for dead in (False, True)], tmp_path / "x")
    drawn[0].draw_without_rendering()
    for axes in drawn[0].axes:
        low, high = axes.get_xlim()
        shown = [
            tick.label1.get_window_extent() for tick in axes.xaxis.get_major_ticks() if low <= tick.get_loc() <= high
        ]
        assert all(left.x1 < right.x0 for left, right in zip(shown, shown[1:], strict=False))


def test_engagement_with_a_working_reel_at_the_usual_speed_does_not_whip():
    run = world_whip.engage(1.2, dead=False, duration_s=0.8)
    assert run.latched.all() and not run.whips
    assert run.wound_in_m[-1] == pytest.approx(1.2 * 0.8 - 0.5 * 0.24 * 0.8**2, abs=0.06)  # 0.24 m/s^2 over 3 m


@pytest.mark.parametrize(
    ("offset_m", "outcome"), [(0.2, Outcome.CONTACT), (0.3, Outcome.RIM_STRIKE), (0.35, Outcome.MISS)]
)
def test_probe_beside_the_axis_is_captured_strikes_the_rim_or_misses_as_the_ring_is_wide(offset_m, outcome):
    assert world_contact.miss_from_m() == pytest.approx(0.308)
    assert world_contact.shoot(1.2, offset_m, 45.0).outcome is outcome


def test_stroke_made_by_hand_is_read_right():
    """10 s of holding 1 % over the set-point, let go at 4 m, then a way out at 2 m/s with 0.05 m beyond full trail."""
    static, held = 1900.0, 10_000
    way_out = np.concatenate([4.0 - 0.002 * np.arange(2025), np.zeros(1000)])
    position = np.concatenate([np.full(held, 4.0), way_out])
    run = world_reel.Stroke(
        speed_m_s=1.2,
        static_n=static,
        pushed_s=9.0,
        tension_n=np.full(len(position), 1.01 * REEL.set_point_fraction * static),
        wound_in_m=position,
        rate_m_s=np.gradient(position, 1e-3),
        latched=np.arange(len(position)) < held,
    )
    push, back = world_reel._held(run, REEL)["ours"], world_reel._returned(run, REEL)["ours"]
    assert push["rms_percent_of_set_point"] == pytest.approx(1.0)
    assert back["let_go_at_m"] == 4.0 and back["overshoot_m"] == pytest.approx(0.048, abs=0.003)
    assert back["fastest_m_s"] == pytest.approx(2.0, rel=0.01)
    assert back["to_full_trail_s"] == pytest.approx(1.975, abs=0.05)
    assert back["green_s"] == pytest.approx((4.0 - REEL.refuelling_from_m) / 2.0, abs=0.01)
