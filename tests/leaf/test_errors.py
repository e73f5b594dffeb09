import math
import pickle
from dataclasses import dataclass, field

import numpy as np
import pytest

from dockair.errors import DockairError, MachineError, check_numbers


def test_one_line_says_where_expected_got_and_what_exists():
    error = DockairError("gust.model", expected="a model", got="karman", exists=["none", "dryden"])
    assert str(error) == "gust.model: expected a model, got 'karman'; exists: none, dryden"
    assert error.exit_code == 2


@pytest.mark.parametrize(
    ("got", "ends"),
    [
        ("karman", "exists: none, dryden, von_karman; did you mean von_karman?"),
        ("dryedn", "; did you mean dryden?"),
        ("dryden", "exists: none, dryden, von_karman"),  # which exists, and cannot be had here
        ("calm", "exists: none, dryden, von_karman"),  # like none of them
        (["dryedn"], "exists: none, dryden, von_karman"),
    ],
)
def test_the_name_that_is_nearest_to_a_misspelt_one_is_asked_for(got, ends):
    said = str(DockairError("gust.model", expected="a model", got=got, exists=["none", "dryden", "von_karman"]))
    assert said.endswith(ends)


def test_the_same_error_said_of_another_place_keeps_the_rest():
    error = DockairError("model", expected="a model", got="dryedn", exists=["none", "dryden"], also=["seed", "sun.up"])
    assert str(error.at("p.toml: gust.model")) == (
        "p.toml: gust.model: expected a model, got 'dryedn'; exists: none, dryden; did you mean dryden?; "
        "also wrong: seed, sun.up"
    )


def test_zero_is_said_and_nothing_is_not():
    assert str(DockairError("n", expected="n > 0", got=0)) == "n: expected n > 0, got 0"
    assert str(DockairError("file", expected="a file", got=None)) == "file: expected a file"


def test_machine_error_says_the_remedy_and_leaves_with_3():
    error = MachineError("EGL", expected="an off-screen context", remedy="apt install libegl1")
    assert str(error) == "EGL: expected an off-screen context; apt install libegl1"
    assert error.exit_code == 3
    assert isinstance(error, DockairError)


@pytest.mark.parametrize(
    "error",
    [
        DockairError("n", expected="a number", got=lambda: None),  # which cannot be pickled
        MachineError("EGL", expected="an off-screen context", remedy="apt install libegl1"),
    ],
)
def test_another_process_raises_the_same_line(error):
    """Gymnasium's vector environments hand over the error and raise its type with it as the only argument."""
    received = pickle.loads(pickle.dumps(error))
    again = type(received)(received)
    assert type(again) is type(error)
    assert str(again) == str(received) == str(error)
    assert again.exit_code == error.exit_code


@dataclass(frozen=True)
class _Inner:
    """One of those that a field may be."""


@dataclass(frozen=True)
class _Settings:
    """One field of each kind that is looked at, and two that are not."""

    above: float = 1.0
    from_zero: float = 0.0
    signed: float = -1.0
    endless: float = math.inf
    share: float = 0.0
    sure: float = 0.9
    count: int = 1
    vector: tuple[float, float] = (1.0, 2.0)
    many: tuple[float, ...] = (1.0,)
    inner: _Inner = field(default_factory=_Inner)
    name: str = ""
    maybe: float | None = None

    def __post_init__(self) -> None:
        check_numbers(
            "here",
            self,
            zero=("from_zero", "share"),
            signed=("signed",),
            infinite=("endless",),
            below_one=("share", "sure"),
        )


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"above": 0.0}, "here.above: expected a finite number above 0, got 0.0"),
        ({"above": math.inf}, "here.above: expected a finite number above 0, got inf"),
        ({"above": math.nan}, "here.above: expected a finite number above 0, got nan"),
        ({"above": True}, "here.above: expected a finite number above 0, got True"),
        ({"above": "1"}, "here.above: expected a finite number above 0, got '1'"),
        ({"above": None}, "here.above: expected a finite number above 0"),
        ({"from_zero": -1e-9}, "here.from_zero: expected a finite number from 0 on, got -1e-09"),
        ({"signed": -math.inf}, "here.signed: expected a finite number, got -inf"),
        ({"endless": math.nan}, "here.endless: expected a number above 0, got nan"),
        ({"endless": -math.inf}, "here.endless: expected a number above 0, got -inf"),
        ({"share": 1.0}, "here.share: expected a number from 0 on, below 1, got 1.0"),
        ({"share": -0.1}, "here.share: expected a number from 0 on, below 1, got -0.1"),
        ({"sure": 0.0}, "here.sure: expected a number above 0, below 1, got 0.0"),
        ({"sure": math.nan}, "here.sure: expected a number above 0, below 1, got nan"),
        ({"count": 0}, "here.count: expected an integer from 1 on, got 0"),
        ({"vector": (1.0, 0.0)}, "here.vector: expected finite numbers above 0, got (1.0, 0.0)"),
        ({"vector": (1.0, 2.0, 3.0)}, "here.vector: expected 2 numbers, got (1.0, 2.0, 3.0)"),
        ({"vector": 1.0}, "here.vector: expected 2 numbers, got 1.0"),
        ({"vector": {1.0, 2.0}}, "here.vector: expected 2 numbers"),
        ({"vector": np.array(1.0)}, "here.vector: expected 2 numbers, got 1.0"),
        ({"vector": np.ones((2, 2))}, "here.vector: expected finite numbers above 0"),
        ({"many": ()}, "here.many: expected numbers, got ()"),
        ({"inner": None}, "here.inner: expected _Inner"),
    ],
)
def test_a_number_of_settings_that_is_none_or_too_small_is_refused_in_one_line(values, said):
    with pytest.raises(DockairError) as refused:
        _Settings(**values)
    assert str(refused.value).startswith(said)


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"above": 3, "count": np.int64(2)},
        {"sure": math.nextafter(1.0, 0.0), "share": 0.5},
        {"above": np.float32(0.5), "vector": np.array([1.0, 2.0])},
        {"vector": [1, 2], "many": (1.0, 2.0, 3.0)},
        {"maybe": -1.0, "name": "any"},
    ],
)
def test_numbers_of_any_kind_are_taken(values):
    assert _Settings(**values) is not None
