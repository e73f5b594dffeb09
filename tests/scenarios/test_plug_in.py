"""What a navigator of one's own has to be, and what is said of one that is not."""

import copy
import dataclasses
import linecache
import re

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import ImuSample, LedObservation, NavSolution, ReceiverCommand, Window
from dockair.nav.guidance.phases import Phase
from dockair.nav.navigator import Navigator
from dockair.scenarios import plug_in
from dockair.scenarios.loop import fly
from dockair.scenarios.message_log import estimate_row
from dockair.scenarios.navigator_recipe import NavigatorRecipe
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


class FailsBelow(Steps):
    def step(self, imu, frame):
        return self.divide(0.0)

    def divide(self, by):
        return 1.0 / by  # the line that fails, not the one that called it


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
        (FailsBelow, _step, ZeroDivisionError, "return 1.0 / by"),
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


GOOD = NavSolution(
    time_stamp_s=1.0, valid=True, phase="join_up", status="", p_PD_B=np.zeros(3), v_PD_B=np.zeros(3), R_BD=np.eye(3),
    covariance=np.eye(9), command=ReceiverCommand(), window=None, frame_time_stamp_s=float("nan"),
    candidates_px=np.empty((0, 2)), led_pixels_px=np.full((8, 2), np.nan),
)  # fmt: skip


class Overwrites(Steps):
    """Keeps all arrays that it is given and answers; writes into them in every tick."""

    def __init__(self, sheets):
        command = ReceiverCommand(velocity_m_s=np.zeros(3), acceleration_m_s2=np.zeros(3))
        self.answer = dataclasses.replace(GOOD, p_PD_B=np.zeros(3), covariance=np.eye(9), command=command)

    def step(self, imu, frame):
        given = [sample.angular_rate_rad_s for sample in imu] + [sample.specific_force_m_s2 for sample in imu]
        answered = [self.answer.p_PD_B, self.answer.covariance, *self._of_the_command()]
        for array in given + answered + ([] if frame is None else [frame.centroids_px, frame.sigma_px]):
            array += 1.0
        if frame is not None:
            frame.led_numbers[:] = 0
        return self.answer

    def _of_the_command(self):
        return self.answer.command.velocity_m_s, self.answer.command.acceleration_m_s2


def test_a_navigator_that_overwrites_its_arrays_changes_nothing_that_was_said_before():
    rates, pixels = np.zeros(3), np.zeros((2, 2))
    imu = (ImuSample(time_stamp_s=0.0, angular_rate_rad_s=rates, specific_force_m_s2=rates),)
    seen = LedObservation(time_stamp_s=0.0, led_numbers=np.array([3, 4]), centroids_px=pixels, sigma_px=np.ones(2))
    navigator = Overwrites(None)
    first = step_navigator(navigator, imu, seen)
    before = copy.deepcopy(_numbers_of(first))
    second = step_navigator(navigator, imu, seen)
    for name, now in _numbers_of(first).items():
        np.testing.assert_array_equal(now, before[name])
    assert second.p_PD_B[0] == second.command.velocity_m_s[0] == first.p_PD_B[0] + 1.0
    assert not rates.any() and not pixels.any() and seen.led_numbers.tolist() == [3, 4] and (seen.sigma_px == 1.0).all()


def _numbers_of(solution):
    return {name: value for name, value in estimate_row(solution).items() if not isinstance(value, str)}


class CountsOn(Steps):
    """From the start's place, which it did not copy."""

    def __init__(self, sheets):
        self.p = sheets.start.p_PD_B

    def step(self, imu, frame):
        self.p += 1.0


def test_the_start_is_not_to_be_written_into_in_a_flight_as_in_its_replay():
    changes = {"navigation.navigator": f"{HERE}:CountsOn", "camera.sensing": "measurements"}
    with pytest.raises(DockairError, match=r"CountsOn: expected step.*got 'ValueError: output array is read-only \("):
        fly(load_scenario("still_air", changes), 0)


class Answers(Steps):
    def __init__(self, **changes):
        self.answer = dataclasses.replace(GOOD, **changes)

    def step(self, imu, frame):
        return self.answer


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"valid": np.bool_(False), "p_PD_B": np.full(3, np.nan), "covariance": np.full((9, 9), np.nan)},
        {"window": Window(0, 10, np.int64(0), 10), "exposure_s": 1e-4, "candidates_px": np.zeros((5, 2))},
        {"time_stamp_s": 3, "covariance": np.full((9, 9), np.nan)},
        {"p_PD_B": np.ma.masked_array(np.ones(3), mask=[0, 1, 0])},
    ],
)
def test_a_solution_that_can_be_flown_is_passed_on(changes):
    navigator = Answers(**changes)
    passed_on = step_navigator(navigator, (), None)
    for name, value in estimate_row(navigator.answer).items():
        np.testing.assert_array_equal(estimate_row(passed_on)[name], value)
    assert type(passed_on.p_PD_B) is np.ndarray


@pytest.mark.parametrize("kind", [np.float16, np.longdouble])
def test_floats_of_a_kind_that_numpys_linear_algebra_does_not_take_are_passed_on_as_64_bit(kind):
    answer = {"p_PD_B": np.full(3, 0.5, kind), "R_BD": np.eye(3, dtype=kind), "covariance": np.eye(9, dtype=kind)}
    command = ReceiverCommand(velocity_m_s=np.full(3, 0.25, kind))
    passed_on = step_navigator(Answers(**answer, command=command), (), None)
    for name, answered in answer.items():
        assert getattr(passed_on, name).dtype == np.float64
        np.testing.assert_array_equal(getattr(passed_on, name), answered)
    assert passed_on.command.velocity_m_s.dtype == np.float64 and passed_on.command.velocity_m_s[0] == 0.25


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"command": None}, "command: expected a ReceiverCommand, got 'None'"),
        ({"command": (1, 2)}, "command: expected a ReceiverCommand"),
        (
            {"command": ReceiverCommand(velocity_m_s=np.full(3, np.nan))},
            "command.velocity_m_s: expected an array of 3 finite numbers, got '[nan, nan, nan]'",
        ),
        (
            {"command": ReceiverCommand(velocity_m_s=[0.0, 0.0, 0.0])},
            "command.velocity_m_s: expected an array of 3 finite numbers, got 'the list [0.0, 0.0, 0.0]'",
        ),
        ({"command": ReceiverCommand(acceleration_m_s2=None)}, "command.acceleration_m_s2"),
        ({"command": ReceiverCommand(velocity_m_s=np.zeros(2))}, "command.velocity_m_s"),
        ({"command": ReceiverCommand(climb_rad=float("nan"))}, "command.climb_rad: expected a finite number"),
        ({"command": ReceiverCommand(turn_rate_rad_s=None)}, "command.turn_rate_rad_s: expected a finite number"),
        ({"p_PD_B": np.zeros(2)}, "p_PD_B: expected an array (3,) of numbers, got '[0.0, 0.0]'"),
        ({"p_PD_B": "here"}, "p_PD_B: expected an array"),
        (
            {"p_PD_B": np.zeros(3, dtype=complex)},
            "p_PD_B: expected an array (3,) of numbers, got 'an array (3,) of complex128'",
        ),
        ({"p_PD_B": np.full(3, np.nan)}, "p_PD_B: expected finite numbers while valid"),
        ({"R_BD": np.zeros(3)}, "R_BD: expected an array (3, 3) of numbers"),
        ({"R_BD": np.zeros((3, 3))}, "R_BD: expected a rotation"),
        ({"R_BD": -np.eye(3)}, "R_BD: expected a rotation"),
        ({"R_BD": np.full((3, 3), np.nan)}, "R_BD: expected a rotation"),
        ({"R_BD": np.zeros((3, 3)), "valid": False}, "R_BD: expected a rotation"),
        ({"covariance": np.eye(3)}, "covariance: expected an array (9, 9) of numbers"),
        ({"covariance": None}, "covariance"),
        ({"covariance": -np.eye(9)}, "covariance: expected no variance below 0"),
        ({"candidates_px": []}, "candidates_px: expected an array (n, 2) of numbers, got 'the list []'"),
        ({"led_pixels_px": np.zeros((4, 2))}, "led_pixels_px: expected an array (8, 2) of numbers"),
        ({"valid": None}, "valid: expected True or False, got 'None'"),
        ({"status": None}, "status: expected text"),
        ({"phase": Phase.APPROACH}, "phase: expected text, got"),
        ({"time_stamp_s": "x"}, "time_stamp_s: expected a finite number"),
        ({"time_stamp_s": np.array(1.0)}, "time_stamp_s: expected a finite number, got 'an array () of float64'"),
        ({"time_stamp_s": float("nan")}, "time_stamp_s: expected a finite number"),
        ({"frame_time_stamp_s": None}, "frame_time_stamp_s: expected a number, or NaN"),
        ({"heading_rad": None}, "heading_rad"),
        ({"exposure_s": -1.0}, "exposure_s: expected above 0, or NaN"),
        ({"exposure_s": 0.0}, "exposure_s: expected above 0, or NaN"),
        ({"window": (0, 0, 10, 10)}, "window: expected a Window of whole numbers, or None"),
        ({"window": Window(0.5, 10, 0, 10)}, "window"),
    ],
)
def test_a_solution_that_could_not_be_flown_logged_or_judged_is_refused_by_its_field(changes, said):
    with pytest.raises(DockairError) as refused:
        step_navigator(Answers(**changes), (), None)
    assert f"{HERE}:Answers: {said}" in str(refused.value) and "\n" not in str(refused.value)


class MakesAnother(Steps):
    def __new__(cls, sheets):
        return 3


def test_a_class_that_makes_something_else_is_refused():
    with pytest.raises(DockairError, match=r"expected a navigator with step\(imu, frame\), got 'int'"):
        NavigatorRecipe(class_name=f"{HERE}:MakesAnother", sheets=None).build()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "import numpy as np\nX = np.zerosx(3)\n",
            r"AttributeError: module 'numpy' has no attribute 'zerosx' \(.*, line 2\)",
        ),
        ("raise ValueError('at\\nimport')\n", r"ValueError: at import \(.*, line 1\)"),
        ("import nosuchmod\n", r"ModuleNotFoundError: No module named 'nosuchmod' \(.*, line 1\)"),
    ],
)
def test_a_module_that_fails_is_said_with_its_line(tmp_path, monkeypatch, text, said):
    (tmp_path / "fails_at_import.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(DockairError, match=said):
        navigator_class_of("fails_at_import:MyNavigator")


@pytest.mark.parametrize(
    ("name", "got"),
    [
        ("nosuch:X", "No module named 'nosuch'"),
        ("nosuch.deep:X", "No module named 'nosuch'"),
        ("os:Nobody", "no attribute"),
    ],
)
def test_what_does_not_exist_is_said_plainly(name, got):
    with pytest.raises(DockairError, match=got) as refused:
        navigator_class_of(name)
    assert "line" not in str(refused.value)


def test_a_class_that_says_nothing_of_its_arguments_is_believed_to_take_the_sheets(monkeypatch):
    def says_nothing(made):
        raise ValueError("no signature found")

    monkeypatch.setattr(plug_in.inspect, "signature", says_nothing)
    assert navigator_class_of("dockair.nav.navigator:Navigator") is Navigator
