import pickle

import pytest

from dockair.errors import DockairError, MachineError


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
