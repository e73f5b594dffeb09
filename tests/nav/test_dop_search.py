"""The search behind the choice of landmarks, kernel by kernel, against all choices and against differences."""

from itertools import combinations
from math import comb

import numpy as np
import pytest

from dockair.nav.dop.search import _exchange, _feasible, _gradient, _lower_bound, branch_and_bound, exhaustive

WANTED = 2
PRIOR = 1e-3 * np.eye(4)


def pieces_of(n, seed):
    """(n, 4, 4) information of n landmarks that see one direction each."""
    h = np.random.default_rng(seed).standard_normal((n, 4))
    return np.einsum("ni,nj->nij", h, h)


def value_of(N):
    return np.trace(np.linalg.inv(N)[-WANTED:, -WANTED:])


def a_node(n, seed):
    """(n,) landmarks decided on, 1 in and -1 out, and how many are to be in: some are still to be taken."""
    rng = np.random.default_rng(seed)
    state = rng.permutation(np.repeat([1, -1, 0], [2, 2, n - 4])).astype(np.int8)
    return state, int(rng.integers(3, n - 2))


def test_all_choices_are_tried_and_of_equal_ones_the_first_is_taken():
    value, chosen, tried = exhaustive(PRIOR, np.tile(np.eye(4), (6, 1, 1)), 3, WANTED)
    assert tried == comb(6, 3)
    assert chosen.tolist() == [0, 1, 2]
    assert value == pytest.approx(WANTED / (3.0 + 1e-3))


def test_the_gradient_is_that_of_differences():
    pieces, w = pieces_of(7, 1), np.random.default_rng(2).uniform(0.2, 1.0, 7)

    def at(weights):
        return PRIOR + np.einsum("n,nij->ij", weights, pieces)

    g, h = np.empty(7), 1e-5
    _gradient(np.linalg.cholesky(at(w)), pieces, WANTED, g)
    for i, e in enumerate(h * np.eye(7)):
        assert -g[i] == pytest.approx((value_of(at(w + e)) - value_of(at(w - e))) / (2.0 * h), rel=1e-5)


def test_the_bound_of_a_node_is_below_its_best_choice_and_much_nearer_than_information_of_all():
    """Eq. (1) takes all that is open; Eq. (2) closes most of what that leaves to the best choice."""
    n, closed = 10, []
    for seed in range(60):
        pieces, (state, count) = pieces_of(n, seed), a_node(n, seed)
        inside, open_ = np.flatnonzero(state == 1), np.flatnonzero(state == 0)
        sums = [PRIOR + pieces[[*inside, *choice]].sum(axis=0) for choice in combinations(open_, count - len(inside))]
        best, all_taken = min(map(value_of, sums)), value_of(PRIOR + pieces[state >= 0].sum(axis=0))
        bound = _lower_bound(PRIOR, pieces, state, count, WANTED, np.ones(n))
        assert all_taken * (1.0 - 1e-9) <= bound <= best * (1.0 + 1e-9)
        closed.append((bound - all_taken) / (best - all_taken) if best > all_taken * (1.0 + 1e-9) else 1.0)
    assert np.mean(closed) > 0.55


def test_weights_fit_a_node_and_keep_their_proportions_below_one():
    for seed in range(30):
        state, count = a_node(9, seed)
        rest, w = count - 2, np.random.default_rng(seed).uniform(0.0, 2.0, 9) ** 3
        before, open_ = w.copy(), state == 0
        _feasible(state, rest, w)
        assert (w[state == 1] == 1.0).all() and (w[state == -1] == 0.0).all()
        assert w[open_].sum() == pytest.approx(rest) and w.max() <= 1.0
        below = open_ & (w < 1.0)
        if below.any():
            ratio = w[below] / before[below]
            np.testing.assert_allclose(ratio, ratio[0])
            assert (before[open_ & (w == 1.0)] * ratio[0] >= 1.0 - 1e-9).all()


def test_exchanges_end_where_no_single_one_is_better():
    for seed in range(20):
        pieces, chosen = pieces_of(9, seed), np.array([0, 1, 2, 3])
        at_first = value_of(PRIOR + pieces[chosen].sum(axis=0))
        value = _exchange(PRIOR, pieces, chosen, WANTED)
        assert value <= at_first * (1.0 + 1e-9)
        assert value == pytest.approx(value_of(PRIOR + pieces[chosen].sum(axis=0)), rel=1e-9)
        outside = set(range(9)) - set(chosen.tolist())
        assert len(outside) == 5
        for place in range(4):
            for enter in outside:
                other = chosen.copy()
                other[place] = enter
                assert value_of(PRIOR + pieces[other].sum(axis=0)) >= value * (1.0 - 1e-6)


# landmarks, members and seed of few landmarks whose exchanges end 1 to 38 % above the best choice
MISSED = [(6, 4, 661), (6, 4, 812), (6, 4, 889), (6, 4, 1401), (7, 4, 18), (7, 4, 1112), (7, 4, 1510), (7, 4, 1540)]
MISSED += [(7, 5, 2398), (8, 5, 156), (8, 5, 785), (8, 5, 1439), (8, 5, 2450), (8, 6, 1740)]


@pytest.mark.parametrize(("n", "count", "seed"), MISSED)
def test_what_exchanges_miss_is_found_and_what_is_said_before_is_a_bound(n, count, seed):
    """Cut after each number of nodes: never a choice better than the best, nor a bound above it."""
    pieces = pieces_of(n, seed)
    best, members, _ = exhaustive(PRIOR, pieces, count, WANTED)
    assert branch_and_bound(PRIOR, pieces, count, WANTED, 1)[0] > 1.01 * best
    for most in range(1, 60):
        value, chosen, nodes, bound = branch_and_bound(PRIOR, pieces, count, WANTED, most)
        assert bound <= best * (1.0 + 1e-9) and value >= best * (1.0 - 1e-9)
        assert value == pytest.approx(value_of(PRIOR + pieces[chosen].sum(axis=0)), rel=1e-6)
    assert nodes < most and bound == value
    assert sorted(chosen) == members.tolist() and value == pytest.approx(best, rel=1e-9)
