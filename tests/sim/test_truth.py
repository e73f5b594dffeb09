"""Truth: cut out of what was seen when it is read, and the same however it is read."""

import copy
import pickle
from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.sim.truth import Truth

FORWARD = ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0]))


def values(truth: Truth) -> dict[str, object]:
    return {field.name: getattr(truth, field.name) for field in fields(Truth)}


def same(one: Truth, other: Truth) -> None:
    for name, value in values(one).items():
        np.testing.assert_array_equal(np.asarray(getattr(other, name)), np.asarray(value), err_msg=name)


def test_truth_read_late_is_the_one_read_at_once(make_world):
    """Two worlds fly the same; of one every field is read at each tick, of the other only at the end."""
    at_once, late = make_world(), make_world()
    read = [values(at_once.step(FORWARD)) for _ in range(30)]
    unread = [late.step(FORWARD) for _ in range(30)]
    for before, truth in zip(read, unread, strict=True):
        for name, value in before.items():
            np.testing.assert_array_equal(np.asarray(getattr(truth, name)), np.asarray(value), err_msg=name)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda t: pickle.loads(pickle.dumps(t)), replace])
def test_copies_of_a_truth_that_nobody_has_read_are_whole(make_world, copied):
    one, other = make_world(), make_world()
    same(one.step(FORWARD), copied(other.step(FORWARD)))


def test_the_tip_seen_from_the_drogue_is_the_one_of_the_other_fields(make_world):
    truth = make_world().step(FORWARD)
    np.testing.assert_allclose(truth.p_DP, truth.R_WD.T @ (truth.p_WP - truth.p_WD), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(replace(truth).p_DP, truth.p_DP, rtol=0.0, atol=1e-14)


def test_truth_cannot_be_changed_and_has_no_other_fields(make_world):
    truth = make_world().step(FORWARD)
    with pytest.raises(FrozenInstanceError):
        truth.tick = 3
    with pytest.raises(AttributeError):
        truth.p_WX  # noqa: B018
