"""What a navigator of one's own has to be, and what is said of one that is not."""

import linecache
import re

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import NavSolution
from dockair.nav.navigator import Navigator
from dockair.scenarios.loop import fly
from dockair.scenarios.message_log import NavigatorRecipe
from dockair.scenarios.plug_in import announce_to, navigator_class_of, signal_to, step_navigator
from dockair.scenarios.schema import load_scenario

HERE = __name__


class Steps:
    """A navigator, as far as can be told without flying."""

    def __init__(self, sheets, settings=None):
        self.made_of = sheets, settings

    def step(self, imu, frame) -> NavSolution | None: ...


class NoStep:
    def __init__(self, sheets): ...


class StepIsAValue(NoStep):
    step = 3


class NoSheets(Steps):
    def __init__(self): ...


class TooMuch(Steps):
    def __init__(self, sheets, another): ...


class Raises(Steps):
    def __init__(self, sheets):
        raise KeyError("no such\nmember")


class Refuses(Steps):
    def __init__(self, sheets):
        raise DockairError("sheets.gyro", expected="a gyro", got=None)


def made_by_a_function(sheets):
    return Steps(sheets)


@pytest.mark.parametrize("found", [Steps, Navigator], ids=lambda found: found.__name__)
def test_a_class_with_a_step_made_of_the_sheets_is_one(found):
    assert navigator_class_of(f"{found.__module__}:{found.__name__}") is found


@pytest.mark.parametrize(
    ("name", "got"),
    [
        ("os:path", "an object of module"),
        (f"{HERE}:made_by_a_function", "an object of function"),
        (f"{HERE}:NoStep", "a class without step"),
        (f"{HERE}:StepIsAValue", "a class without step"),
        (f"{HERE}:NoSheets", "a constructor that takes ()"),
        (f"{HERE}:TooMuch", "a constructor that takes (sheets, another)"),
    ],
)
def test_what_is_no_navigator_is_refused_by_its_name(name, got):
    with pytest.raises(DockairError) as refused:
        navigator_class_of(name)
    assert refused.value.where == name and refused.value.got == got
    assert refused.value.expected.startswith("a class that is made of (sheets) and has step")


def test_a_constructor_that_fails_is_said_in_one_line_with_its_place():
    with pytest.raises(DockairError, match=r"Raises: expected a navigator that can be made of the sheets") as refused:
        NavigatorRecipe(class_name=f"{HERE}:Raises", sheets=None).build()
    assert "KeyError" in str(refused.value) and "test_plug_in.py, line" in str(refused.value)
    assert "\n" not in str(refused.value) and isinstance(refused.value.__cause__, KeyError)


def test_a_constructor_s_own_refusal_is_passed_on():
    with pytest.raises(DockairError, match=r"sheets\.gyro"):
        NavigatorRecipe(class_name=f"{HERE}:Refuses", sheets=None).build()


def test_settings_are_handed_over_where_there_are_any():
    assert NavigatorRecipe(class_name=f"{HERE}:Steps", sheets=None, settings=7).build().made_of == (None, 7)


class Fails(Steps):
    def step(self, imu, frame):
        return np.linalg.inv(np.ones((2, 3)))  # numpy raises, this line is at fault

    def announce(self, announcement):
        return {}["no such\nkey"]

    def signal(self, signal):
        return {}["nor such"]


class Ends(Steps):
    def step(self, imu, frame):
        raise SystemExit(7)


def _step(navigator):
    return step_navigator(navigator, (), None)


def _announce(navigator):
    return announce_to(navigator, None)


def _signal(navigator):
    return signal_to(navigator, None)


@pytest.mark.parametrize(
    ("failing", "tell", "kind", "line"),
    [
        (Fails, _step, np.linalg.LinAlgError, "np.linalg.inv("),
        (Fails, _announce, KeyError, 'return {}["no such'),
        (Fails, _signal, KeyError, 'return {}["nor such"]'),
        (Ends, _step, SystemExit, "raise SystemExit(7)"),
    ],
)
def test_what_ones_own_navigator_raises_is_one_line_with_its_own_line(failing, tell, kind, line):
    with pytest.raises(DockairError, match=f"{failing.__name__}: expected .* without an exception") as refused:
        tell(failing(None))
    said = str(refused.value)
    file, number = re.search(r"\((\S+), line (\d+)\)", said).groups()
    assert file == __file__ and line in linecache.getline(file, int(number))
    assert kind.__name__ in said and "\n" not in said and isinstance(refused.value.__cause__, kind)


def test_a_step_that_answers_no_solution_is_refused_by_name():
    with pytest.raises(DockairError, match=r"Steps: expected a NavSolution from step\(imu, frame\), got 'NoneType'"):
        _step(Steps(None))


def test_a_mistake_of_ours_and_a_refusal_are_passed_on(monkeypatch):
    monkeypatch.setattr(Fails, "__module__", Navigator.__module__)
    with pytest.raises(np.linalg.LinAlgError):
        _step(Fails(None))
    monkeypatch.setattr(Steps, "step", lambda self, imu, frame: Refuses(None))
    with pytest.raises(DockairError, match=r"sheets\.gyro"):
        _step(Steps(None))


def test_a_flight_with_a_navigator_that_fails_ends_in_that_line():
    changes = {"navigation.navigator": f"{HERE}:Fails", "camera.sensing": "measurements"}
    with pytest.raises(DockairError, match=r"Fails: expected step\(imu, frame\) without an exception, got "):
        fly(load_scenario("still_air", changes), 0)
