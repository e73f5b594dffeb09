"""Parameters that are drawn: each sampler has the property that it is chosen for."""

import math

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.scenarios.campaign.draws import Draw, grid, samples


def draw(**keys) -> Draw:
    made = Draw.model_validate(keys)
    made.check("draw")
    return made


TWO = {"a": draw(low=2.0, high=4.0), "b": draw(values=["x", "y", "z"])}


def test_a_latin_hypercube_has_one_point_in_each_slice_of_every_key():
    count = 40
    draws = {"a": draw(low=0.0, high=1.0), "b": draw(low=-3.0, high=5.0), "c": draw(low=1.0, high=100.0, log=True)}
    points = samples(draws, "latin_hypercube", count, 7)
    units = {
        "a": [p["a"] for p in points],
        "b": [(p["b"] + 3.0) / 8.0 for p in points],
        "c": [math.log(p["c"], 100.0) for p in points],
    }
    for values in units.values():
        assert sorted(int(u * count) for u in values) == list(range(count))


def test_random_points_do_not_fill_every_slice_and_are_independent():
    points = samples({"a": draw(low=0.0, high=1.0), "b": draw(low=0.0, high=1.0)}, "random", 4000, 7)
    a, b = (np.array([p[key] for p in points]) for key in "ab")
    assert len(set((a * 4000).astype(int))) < 3000  # 1 - 1/e of the slices are hit, 2528 of 4000
    assert abs(np.corrcoef(a, b)[0, 1]) < 4.0 / math.sqrt(4000)  # false alarm 6e-5
    assert abs(a.mean() - 0.5) < 4.0 * math.sqrt(1.0 / 12.0 / 4000)


def test_more_random_points_begin_with_the_fewer():
    assert samples(TWO, "random", 60, 1)[:20] == samples(TWO, "random", 20, 1)


@pytest.mark.parametrize("sampler", ["random", "latin_hypercube"])
def test_points_depend_on_the_seed_and_on_nothing_else(sampler):
    assert samples(TWO, sampler, 10, 5) == samples(TWO, sampler, 10, 5)
    assert samples(TWO, sampler, 10, 5) != samples(TWO, sampler, 10, 6)


def test_a_grid_is_every_combination_and_meets_both_ends():
    points = grid({"a": draw(low=0.1, high=0.7, points=4), "b": draw(values=[True, False])}, 100)
    assert [(p["a"], p["b"]) for p in points] == [
        (pytest.approx(0.1), True), (0.1, False), (pytest.approx(0.3), True), (pytest.approx(0.3), False),
        (pytest.approx(0.5), True), (pytest.approx(0.5), False), (0.7, True), (0.7, False),
    ]  # fmt: skip
    assert grid({}, 1) == [{}]
    for low, high, log in ((0.3, 0.9, False), (-0.7, 0.1, False), (0.3, 0.9, True), (0.01, 7.0, True)):
        ends = grid({"a": draw(low=low, high=high, log=log, points=2)}, 2)
        assert ends == [{"a": low}, {"a": high}]  # to the bit: else the upper one may lie outside a key's range


def test_a_logarithmic_grid_has_equal_ratios():
    values = [p["a"] for p in grid({"a": draw(low=0.01, high=10.0, log=True, points=4)}, 10)]
    assert values == pytest.approx([0.01, 0.1, 1.0, 10.0])


def test_listed_values_are_as_frequent_as_each_other_and_keep_their_type():
    points = samples({"a": draw(values=[1, "two", 3.0, True])}, "latin_hypercube", 400, 0)
    counts = {repr(v): sum(repr(p["a"]) == repr(v) for p in points) for v in (1, "two", 3.0, True)}
    assert counts == {"1": 100, "'two'": 100, "3.0": 100, "True": 100}


def test_a_normal_draw_has_its_quantiles():
    values = sorted(p["a"] for p in samples({"a": draw(mean=5.0, sigma=2.0)}, "latin_hypercube", 1000, 0))
    assert values[500] == pytest.approx(5.0, abs=0.01)
    assert values[841] == pytest.approx(7.0, abs=0.02)
    assert values[22] == pytest.approx(1.0, abs=0.1)


def test_a_value_grows_with_its_coordinate_and_at_one_is_the_last():
    """The normal law's by one standard deviation from Phi(0) = 0.5 to Phi(1); values are floor(u n) of n."""
    normal, listed = draw(mean=5.0, sigma=2.0), draw(values=["x", "y", "z"])
    phi_1 = 0.5 * (1.0 + math.erf(math.sqrt(0.5)))
    assert [normal.at(u) for u in (1.0 - phi_1, 0.5, phi_1)] == pytest.approx([3.0, 5.0, 7.0])
    assert [listed.at(u) for u in (0.0, 0.33, 0.34, 0.66, 0.67, 1.0)] == ["x", "x", "y", "y", "z", "z"]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"low": 1.0}, "expected low and high, or values, or mean and sigma, got ['low']"),
        ({"low": 1.0, "high": 1.0}, "draw.high: expected a number above low = 1, got 1.0"),
        ({"low": 1.0, "high": 2.0, "values": [1]}, "got ['high', 'low', 'values']"),
        ({"low": 0.0, "high": 2.0, "log": True}, "draw.low: expected a number above 0 where log = true"),
        ({"values": []}, "draw.values: expected one number, text, true or false at least, got []"),
        ({"values": [[1]]}, "true or false at least, got [[1]]"),
        ({"values": [1], "points": 3}, "expected log and points beside low and high only"),
        ({"mean": 1.0}, "got ['mean']"),
        ({}, "got []"),
    ],
)
def test_a_draw_of_no_form_is_refused(keys, said):
    with pytest.raises(DockairError) as refused:
        draw(**keys)
    assert said in str(refused.value)


def test_a_grid_needs_to_know_its_points_and_has_a_limit():
    for keys in ({"low": 0.0, "high": 1.0}, {"mean": 0.0, "sigma": 1.0}):
        with pytest.raises(DockairError, match="expected values, or low, high and points"):
            grid({"a": draw(**keys)}, 10)
    with pytest.raises(DockairError, match="expected a grid of up to 10 points, got 12"):
        grid({"a": draw(low=0.0, high=1.0, points=4), "b": draw(values=[1, 2, 3])}, 10)
