"""The best k of n landmarks: equal to trying them all, by brute force and by branch and bound."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.dop import SubsetStatus, best_subset, dilution_of_precision, pose_bound
from dockair.nav.dop.subset import SubsetSettings
from dockair.rotations import exp

ZERO, F = np.zeros(3), 0.016
SEARCH = SubsetSettings(exhaustive_up_to=0)
ALL = SubsetSettings(exhaustive_up_to=10**9)


def cloud(n: int, seed: int):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(4.0, 30.0, n), rng.uniform(-4.0, 4.0, (n, 2))])
    return points, dilution_of_precision(points, ZERO, ZERO, F)


@pytest.mark.parametrize("criterion", ["pdop", "adop", "dop"])
@pytest.mark.parametrize(("n", "k"), [(5, 3), (8, 4), (8, 7), (9, 5), (8, 8)])
def test_best_is_the_least_dilution_of_all_choices(n, k, criterion):
    for seed in range(3):
        points, dop = cloud(n, seed)
        best = best_subset(dop, k, criterion)
        every = {
            choice: getattr(dilution_of_precision(points[list(choice)], ZERO, ZERO, F), criterion)
            for choice in combinations(range(n), k)
        }
        least = min(every, key=lambda choice: every[choice])
        assert best.status is SubsetStatus.OPTIMAL and tuple(best.members) == least
        assert best.value == pytest.approx(every[least], rel=1e-6) and best.at_least == best.value


@pytest.mark.parametrize("criterion", ["pdop", "adop", "dop"])
@pytest.mark.parametrize(("n", "k"), [(8, 4), (12, 3), (12, 6), (16, 5), (18, 9), (14, 13)])
def test_branch_and_bound_is_exhaustive_search(n, k, criterion):
    for seed in range(4):
        _, dop = cloud(n, seed)
        searched, tried = best_subset(dop, k, criterion, settings=SEARCH), best_subset(dop, k, criterion, settings=ALL)
        assert searched.status is tried.status is SubsetStatus.OPTIMAL
        assert searched.members.tolist() == tried.members.tolist()
        assert searched.value == pytest.approx(tried.value, rel=1e-9)


@pytest.mark.parametrize(
    ("n", "k", "seed", "criterion"),
    [(14, 4, 92, "adop"), (14, 4, 53, "adop"), (14, 4, 133, "pdop"), (12, 6, 313, "adop")],
)
def test_the_search_leaves_a_choice_that_no_single_exchange_improves(n, k, seed, criterion):
    """Clouds whose first choice, stable under exchanges, is up to 10 % worse than the best."""
    _, dop = cloud(n, seed)
    first = best_subset(dop, k, criterion, settings=SubsetSettings(exhaustive_up_to=0, max_nodes=1))
    searched, tried = (best_subset(dop, k, criterion, settings=setting) for setting in (SEARCH, ALL))
    assert first.value > 1.004 * tried.value
    assert first.status is SubsetStatus.NOT_PROVEN and first.at_least <= tried.value * (1.0 + 1e-9)
    assert searched.members.tolist() == tried.members.tolist() and searched.status is SubsetStatus.OPTIMAL


@pytest.mark.parametrize("criterion", ["pdop", "adop"])
@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_branch_and_bound_is_exhaustive_search_on_a_ring_whose_choices_are_alike(tilt, criterion):
    """Twelve LEDs, many choices equal by symmetry: the value is the same, whichever choice."""
    bound = pose_bound(
        LedRing(count=12).positions_D, exp(np.array([0.0, tilt, 0.0])), np.array([5.0, 0.0, 0.0]), Camera()
    )
    for k in (4, 6, 9):
        searched, tried = (best_subset(bound, k, criterion, settings=setting) for setting in (SEARCH, ALL))
        assert searched.status is SubsetStatus.OPTIMAL
        assert searched.value == pytest.approx(tried.value, rel=1e-6)


def test_forty_landmarks_are_searched_not_tried():
    """8 of 40 are 77 million choices; the bounds leave a few hundred nodes, and no single exchange is better."""
    _, dop = cloud(40, 2)
    best = best_subset(dop, 8, "adop")
    assert best.status is SubsetStatus.OPTIMAL and best.nodes < 5000
    inside = set(best.members.tolist())
    for leave in inside:
        for enter in set(range(40)) - inside:
            N = dop.information[sorted(inside - {leave} | {enter})].sum(axis=0)
            assert np.sqrt(np.trace(np.linalg.inv(N)[3:, 3:])) >= best.value * (1.0 - 1e-6)


def test_leds_chosen_from_the_pose_bound_give_the_bound_of_those_leds():
    points = np.vstack([LedRing().positions_D, [[0.2, 0.1, 0.0], [0.2, -0.1, 0.0]]])
    R, p = exp(np.array([0.0, 0.1, 0.05])), np.array([8.0, 0.3, 0.1])
    best = best_subset(pose_bound(points, R, p, Camera()), 4, "adop")
    alone = pose_bound(points[best.members], R, p, Camera())
    assert best.value == pytest.approx(alone.attitude_sigma_rad, rel=1e-6)
    assert {8, 9} & set(best.members.tolist())  # depth tells the tilt
    position = best_subset(pose_bound(points, R, p, Camera()), 4, "pdop")
    lone = pose_bound(points[position.members], R, p, Camera())
    assert position.value == pytest.approx(np.hypot(lone.range_sigma_m, lone.lateral_sigma_m), rel=1e-6)


def test_four_of_eight_leds_know_the_attitude_nearly_as_well_as_all():
    """Drogue at 5 m, tilted by 10 deg, 0.1 px: 0.31 deg with every other LED, 0.22 deg with all."""
    bound = pose_bound(
        LedRing().positions_D, exp(np.array([0.0, np.deg2rad(10.0), 0.0])), np.array([5.0, 0.0, 0.0]), Camera()
    )
    four = best_subset(bound, 4, "adop")
    assert four.members.tolist() == [0, 2, 4, 6]
    assert np.rad2deg(four.value) == pytest.approx(0.308, abs=0.001)
    assert np.rad2deg(best_subset(bound, 8, "adop").value) == pytest.approx(0.218, abs=0.001)


def test_the_landmarks_in_the_camera_and_in_the_plane_can_be_chosen_from_too():
    points, dop = cloud(7, 5)
    seen = best_subset(dop.landmarks_in_camera, 4, "pdop")
    least = min(
        dilution_of_precision(points[list(c)], ZERO, ZERO, F).landmarks_in_camera.pdop
        for c in combinations(range(7), 4)
    )
    assert seen.value == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize(
    ("n", "k", "seed", "criterion"), [(11, 5, 1, "dop"), (11, 5, 6, "pdop"), (7, 6, 32, "adop"), (11, 5, 35, "pdop")]
)
def test_a_search_among_landmarks_a_micrometre_off_a_line_ends_with_the_choice_of_all_or_one_as_good(
    n, k, seed, criterion
):
    """Their information nearly cancels, so that a gradient may come out negative, and a sum less a piece too small."""
    off = 1e-6 * np.random.default_rng(seed).standard_normal((n, 3))
    dop = dilution_of_precision(np.arange(n)[:, None] * [1.0, 0.5, 0.2] + [5.0, 0.0, 0.0] + off, ZERO, ZERO, F)
    searched, tried = (best_subset(dop, k, criterion, settings=setting) for setting in (SEARCH, ALL))
    assert searched.status is tried.status is SubsetStatus.OPTIMAL
    assert searched.value == pytest.approx(tried.value, rel=0.02)


def test_when_the_nodes_run_out_it_says_so_and_how_much_better_a_choice_might_be():
    _, dop = cloud(30, 8)
    best = best_subset(dop, 6, "adop")
    cut = best_subset(dop, 6, "adop", settings=SubsetSettings(exhaustive_up_to=0, max_nodes=3))
    assert best.status is SubsetStatus.OPTIMAL and best.nodes > 3
    assert cut.status is SubsetStatus.NOT_PROVEN
    assert cut.at_least < best.value * (1.0 + 1e-9) <= cut.value * (1.0 + 2e-9)
    assert len(cut.members) == 6


def test_a_landmark_that_cannot_be_seen_is_not_chosen():
    points, _ = cloud(8, 3)
    points[[1, 4], 0] *= -1.0
    best = best_subset(dilution_of_precision(points, ZERO, ZERO, F), 6)
    assert best.members.tolist() == [0, 2, 3, 5, 6, 7]
    assert best_subset(dilution_of_precision(points, ZERO, ZERO, F), 7).status is SubsetStatus.TOO_FEW_LANDMARKS


@pytest.mark.parametrize("setting", [SEARCH, ALL], ids=["searched", "tried"])
def test_without_a_choice_there_are_no_members(setting):
    line = dilution_of_precision(np.column_stack([5.0 + np.arange(6), np.arange(6), np.zeros(6)]), ZERO, ZERO, F)
    none = best_subset(line, 4, settings=setting)
    assert none.status is SubsetStatus.SINGULAR and np.isnan(none.value) and none.members.size == 0
    assert best_subset(cloud(6, 1)[1], 2, settings=setting).status is SubsetStatus.TOO_FEW_LANDMARKS


@pytest.mark.parametrize("setting", [SEARCH, ALL], ids=["searched", "tried"])
def test_with_a_prior_two_landmarks_can_be_chosen(setting):
    _, dop = cloud(9, 7)
    prior = np.diag([1e2] * 3 + [1e-3] * 3)
    best = best_subset(dop, 2, "pdop", prior_information=prior, settings=setting)
    every = {
        c: np.sqrt(np.trace(np.linalg.inv(prior + dop.information[list(c)].sum(axis=0))[:3, :3]))
        for c in combinations(range(9), 2)
    }
    assert tuple(best.members) == min(every, key=lambda c: every[c])
    assert best.value == pytest.approx(min(every.values()), rel=1e-9)


def test_same_geometry_same_bits():
    _, dop = cloud(22, 4)
    first, second = (best_subset(dop, 7, "pdop", settings=SEARCH) for _ in range(2))
    assert first.value == second.value and first.members.tobytes() == second.members.tobytes()


@settings(max_examples=60, deadline=None)
@given(
    st.integers(3, 9), st.integers(3, 6), st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from(["pdop", "adop"])
)
def test_searching_and_trying_agree_also_where_landmarks_coincide(n, k, seed, doubled, criterion):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.integers(4, 8, n), rng.integers(-2, 3, (n, 2))]).astype(float)
    points = np.vstack([points, points[:2]]) if doubled else points
    dop = dilution_of_precision(points, ZERO, ZERO, F)
    searched, tried = (best_subset(dop, k, criterion, settings=setting) for setting in (SEARCH, ALL))
    assert searched.status is tried.status
    if tried.status is SubsetStatus.OPTIMAL:
        assert searched.value == pytest.approx(tried.value, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"criterion": "gdop"}, "criterion"),
        ({"count": 0}, "count"),
        ({"count": 2.5}, "count"),
        ({"count": True}, "count"),
        ({"prior_information": np.eye(3)}, "prior_information"),
    ],
)
def test_wrong_arguments_are_refused_by_name(change, where):
    with pytest.raises(DockairError, match=f"^{where}: expected"):
        best_subset(**({"geometry": cloud(6, 1)[1], "count": 4} | change))
