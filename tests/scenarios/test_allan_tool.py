"""`dockair allan`: records of known terms, of the simulator's gyros, and what a person may do wrong with a record."""

import errno
import json
import os
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.scenarios import allan_tool, cli, whole_file
from dockair.sim.imu import Imu, ImuParameters

MTI = load_parameters("imu_mti", ImuParameters)
DEGREE = np.pi / 180.0
HOURS_2, SLOW_HZ = 7200.0, 10.0


@pytest.fixture
def command(monkeypatch, capsys):
    """Run `dockair ...`; exit status, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["dockair", *map(str, arguments)])
        status = 0
        try:
            cli.main()
        except SystemExit as stop:
            status = stop.code or 0
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def _white(seed=0, n=20_000, columns=3, density=2e-4, rate_hz=100.0):
    return density * np.sqrt(rate_hz) * np.random.default_rng(seed).standard_normal((n, columns))


def _simulated(parameters, units=1, seed=0):
    """(n, 3 units) two hours at rest, one unit after the other."""
    records = []
    for unit in range(units):
        streams = (np.random.default_rng((seed, unit, i)) for i in range(3))
        imu = Imu(parameters, SLOW_HZ, *streams, np.eye(3), np.zeros(3))
        records.append(imu.record(round(HOURS_2 * SLOW_HZ)).angular_rate_rad_s)
    return np.hstack(records)


def test_white_noise_of_a_known_density_comes_back(tmp_path):
    """200 s x 3 columns: standard error 0.4 % in density; bound 3 %."""
    np.save(tmp_path / "gyro.npy", _white())
    found = allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s", terms="N")
    assert found.parameters["gyro_noise_density_rad_s_rthz"] == pytest.approx(2e-4, rel=0.03)
    assert (found.samples, found.columns, found.duration_s) == (20_000, 3, 200.0)


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("x_deg_s,y_deg_s,z_deg_s", None),
        ("# gx [deg/s], gy [deg/s], gz [deg/s]", None),
        ("x,y,z", "deg/s"),
        ("", "deg/s"),
    ],
)
def test_units_by_name_or_by_option_and_csv_or_numpy_are_all_the_same_record(tmp_path, header, unit):
    rates = _white(n=3000)
    np.save(tmp_path / "gyro.npy", rates)
    path = tmp_path / "gyro.csv"
    np.savetxt(path, rates / DEGREE, delimiter=",", header=header, comments="", fmt="%.17g")
    if not header:
        path.write_text(path.read_text().lstrip("\n"))
    np.testing.assert_allclose(
        allan_tool.read_record(path, unit), allan_tool.read_record(tmp_path / "gyro.npy", "rad/s"), rtol=1e-12
    )


@pytest.mark.parametrize("name", ["time_s", "Stamp"])
def test_a_column_of_time_is_left_out(tmp_path, name):
    rates = _white(n=300, columns=1)
    path = tmp_path / "gyro.csv"
    table = np.column_stack([np.arange(300) / 100.0, rates])
    np.savetxt(path, table, delimiter=",", header=f"{name},z_rad_s", comments="", fmt="%.17g")
    np.testing.assert_array_equal(allan_tool.read_record(path), rates)


def test_the_sheet_s_keys_are_the_imu_s_own_and_a_scenario_takes_them(command, tmp_path):
    record, sheet = tmp_path / "gyro.npy", tmp_path / "sheet.toml"
    np.save(record, _white() + np.cumsum(1e-6 * _white(1), axis=0))
    status, out, err = command("allan", record, "--rate-hz", "100", "--unit", "rad/s", "--out", sheet)
    assert (status, err) == (0, "")
    written = tomllib.loads(sheet.read_text())
    assert set(written) <= set(ImuParameters.__slots__)
    assert "gyro_noise_density_rad_s_rthz" in written
    for entry in written.values():
        assert set(entry) == {"value", "low", "high", "unit", "source", "status"}
        assert entry["status"] == "measured"
        assert entry["low"] <= entry["value"] <= entry["high"]
    overrides = tomllib.loads(out[out.index("[parameters") :])["parameters"]["imu_mti"]
    assert overrides == {key: pytest.approx(entry["value"]) for key, entry in written.items()}
    taken = load_parameters("imu_mti", ImuParameters, overrides)
    assert taken.gyro_noise_density_rad_s_rthz == pytest.approx(2e-4, rel=0.03)


@pytest.mark.parametrize(
    ("name", "said"), [(b'a "\\.npy', 'a "\\.npy'), (b"a\n\a\x7f.npy", "a\n\a\x7f.npy"), (b"a\xff.npy", "a\ufffd.npy")]
)
def test_a_sheet_is_toml_and_names_its_record_whatever_that_is_called(tmp_path, name, said):
    record, sheet = tmp_path / os.fsdecode(name), tmp_path / "sheet.toml"
    np.save(record, _white(n=2000))
    allan_tool.write_sheet(allan_tool.report(record, 100.0, "rad/s", terms="N"), sheet)
    (entry,) = (entry for entry in tomllib.loads(sheet.read_text()).values() if entry["value"])
    assert entry["source"] == f"Allan deviation of {said}: 3 x 20 s at 100 Hz"


def test_json_is_one_object(command, tmp_path):
    np.save(tmp_path / "gyro.npy", _white())
    status, out, _ = command("allan", tmp_path / "gyro.npy", "--rate-hz", "100", "--unit", "rad/s", "--json")
    assert status == 0
    assert json.loads(out)["parameters"]["gyro_noise_density_rad_s_rthz"] == pytest.approx(2e-4, rel=0.03)


def test_without_bias_instability_no_correlation_time_is_written(tmp_path):
    np.save(tmp_path / "gyro.npy", _white())
    found = allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s", terms="NK")
    assert "gyro_bias_correlation_s" not in found.parameters
    assert "nan" not in allan_tool.sheet_text(found)
    assert "correlation" not in allan_tool.in_words(found)


def test_a_bias_that_no_sheet_holds_is_left_out_though_nothing_else_was_looked_for(tmp_path):
    """What fits white noise best wanders within a sample."""
    np.save(tmp_path / "gyro.npy", _white(n=5000))
    found = allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s", terms="B")
    assert found.caution.startswith("no bias instability: what fits best wanders within 0.0")
    assert found.noise.bias_instability_rad_s == 0.0 and "gyro_bias_correlation_s" not in found.parameters
    assert tomllib.loads(allan_tool.sheet_text(found))["gyro_bias_instability_rad_s"]["value"] == 0.0


def test_the_bias_is_told_in_degrees_an_hour_too(tmp_path):
    """360 degrees an hour are 1e-1 degrees a second."""
    np.save(tmp_path / "gyro.npy", _white(n=5000))
    found = allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s", terms="N")
    noise = replace(found.noise, bias_instability_rad_s=np.deg2rad(0.1), bias_correlation_s=30.0)
    assert "B  bias instability   0.001745 rad/s (360 deg/h)" in allan_tool.in_words(replace(found, noise=noise))


def test_a_record_too_short_to_tell_the_slow_terms_apart_says_so(tmp_path):
    """A Gauss-Markov bias of 20 s, in 200 s and in 2000 s."""
    said = []
    for n in (20_000, 200_000):
        white = np.random.default_rng(3).standard_normal(n)
        bias = lfilter([np.sqrt(1.0 - np.exp(-2.0 / 2000.0))], [1.0, -np.exp(-1.0 / 2000.0)], white)
        np.save(tmp_path / "gyro.npy", 1e-3 * bias + _white(n=n, columns=1)[:, 0])
        found = allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s", terms="NB", bias_correlation_s=21.0)
        assert found.noise.bias_instability_rad_s > 0.0
        said.append(found.caution)
    assert "uncertain" in said[0] and said[1] == ""


@pytest.mark.parametrize(
    ("name", "content", "options", "said"),
    [
        ("gone.csv", None, (), "no such file"),
        ("gyro.mat", "1", (), "CSV or NumPy"),
        ("gyro.csv", "1,2\n3,4\n5,6\n", (), "unit"),
        ("gyro.csv", "x_deg_s\n1\n2\n3\n", ("--unit", "rad/s"), "one unit"),
        ("gyro.csv", "x [mrad/s]\n1\n2\n3\n4\n", (), "unit"),
        ("gyro.csv", "gyro_mdeg_s\n1\n2\n3\n4\n", (), "unit"),
        ("gyro.csv", "x [rad/s^2]\n1\n2\n3\n4\n", (), "unit"),
        ("gyro.csv", "x_deg_s2\n1\n2\n3\n4\n", (), "unit"),
        ("gyro.csv", "x_deg_s\n1\n2\n3\n", ("--unit", "rpm"), "rpm"),
        ("gyro.csv", "x_deg_s,y_deg_s\n1,2\n3\n", (), "rows of numbers"),
        ("gyro.csv", "x_deg_s\n1,2\n3,4\n5,6\n", (), "2 names"),
        ("gyro.csv", "x_deg_s,y_deg_s,z_deg_s\n1,2\n3,4\n5,6\n", (), "2 names"),
        ("gyro.csv", "x_deg_s\n1\nnan\n3\n", (), "finite"),
        ("gyro.csv", "x_deg_s\n1\n2\n", (), "n >= 3"),
        ("gyro.csv", "time_s\n1\n2\n3\n", (), "column of rates"),
        ("gyro.csv", "x_deg_s\n", (), "rows of numbers"),
        ("gyro.npy", "not an array", ("--unit", "rad/s"), "NumPy"),
        ("gyro.csv", "x_deg_s\n1\n2\n3\n4\n", ("--terms", "X"), "terms"),
    ],
)
def test_a_mistake_is_told_in_one_line_and_ends_with_status_two(command, tmp_path, name, content, options, said):
    if content is not None:
        (tmp_path / name).write_text(content)
    status, out, err = command("allan", tmp_path / name, "--rate-hz", "100", *options)
    assert status == 2 and out == ""
    assert said in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ("--bias-correlation-s", "-1"),
            "Invalid value for '--bias-correlation-s': Input should be greater than or equal to 0.001, got '-1'",
        ),
        (
            ("--bias-correlation-s", "1e300"),
            "Invalid value for '--bias-correlation-s': Input should be less than or equal to 10000000, got '1e300'",
        ),
        (("--terms", "X"), "--terms: expected letters of the terms, each once, got 'X'; exists: Q, N, B, K"),
    ],
)
def test_a_mistake_in_an_option_is_told_by_its_name(command, tmp_path, options, said):
    np.save(tmp_path / "gyro.npy", _white(n=100))
    record = ("allan", tmp_path / "gyro.npy", "--unit", "rad/s")
    assert command(*record, "--rate-hz", "100", *options) == (2, "", f"dockair: {said}\n")


def test_a_record_that_cannot_be_is_told_by_its_file(command, tmp_path):
    np.save(tmp_path / "gyro.npy", np.array([1.0, np.nan, 3.0]))
    _, _, err = command("allan", tmp_path / "gyro.npy", "--unit", "rad/s", "--rate-hz", "100")
    assert err == f"dockair: {tmp_path / 'gyro.npy'}: expected finite samples, got '1 that are not'\n"


def test_a_rate_or_a_folder_that_cannot_be_ends_with_status_two(command, tmp_path):
    np.save(tmp_path / "gyro.npy", _white())
    record = ("allan", tmp_path / "gyro.npy", "--unit", "rad/s")
    for rate_hz in ("0", "nan", "1e-300", "9e-4", "1.1e6", "1e300"):
        status, _, err = command(*record, "--rate-hz", rate_hz)
        assert (status, err.count("\n")) == (2, 1) and "'--rate-hz'" in err
    for rate_hz in ("1e-3", "1e6"):
        assert command(*record, "--rate-hz", rate_hz)[0] == 0
    for place in (tmp_path / "gyro.npy" / "sheet.toml", tmp_path):
        status, _, err = command(*record, "--rate-hz", "100", "--out", place)
        assert (status, err.count("\n")) == (2, 1) and str(place) in err


def test_a_sheet_s_folder_is_made_and_a_full_disk_leaves_the_sheet_that_was_there(command, tmp_path, monkeypatch):
    np.save(tmp_path / "gyro.npy", _white())
    sheet = tmp_path / "new" / "sheet.toml"
    record = ("allan", tmp_path / "gyro.npy", "--unit", "rad/s", "--rate-hz", "100", "--out", sheet)
    assert command(*record)[0] == 0
    before = sheet.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(whole_file.os, "fsync", full)
    status, _, err = command(*record)
    assert (status, err.count("\n")) == (3, 1) and "expected room to write" in err
    assert sheet.read_bytes() == before and list(sheet.parent.iterdir()) == [sheet]


def test_terms_beyond_the_sheet_s_range_are_refused_by_name(tmp_path):
    np.save(tmp_path / "gyro.npy", 1e3 * _white())
    with pytest.raises(DockairError, match="gyro_noise_density"):
        allan_tool.sheet_text(allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s"))


@pytest.mark.slow
def test_the_simulator_s_own_terms_come_back(tmp_path):
    """As in the simulator's own test: one unit of two hours, each slow term with the other switched off.

    Standard errors 0.4 % (N), 3 to 8 % (B, K): a false alarm in 100 at worst.
    """
    keys = "gyro_noise_density_rad_s_rthz", "gyro_bias_instability_rad_s", "gyro_rate_random_walk_rad_s_rts"
    N, B, K = (getattr(MTI, key) for key in keys)
    path = tmp_path / "gyro.npy"
    np.save(path, _simulated(replace(MTI, gyro_bias_instability_rad_s=0.0), seed=1))
    walk = allan_tool.report(path, SLOW_HZ, "rad/s", terms="NK").parameters
    np.save(path, _simulated(replace(MTI, gyro_rate_random_walk_rad_s_rts=0.0), seed=2))
    floor = allan_tool.report(
        path, SLOW_HZ, "rad/s", terms="NB", bias_correlation_s=MTI.gyro_bias_correlation_s
    ).parameters
    assert walk[keys[0]] == pytest.approx(N, rel=0.03)
    assert floor[keys[0]] == pytest.approx(N, rel=0.03)
    assert walk[keys[2]] == pytest.approx(K, rel=0.2)
    assert floor[keys[1]] == pytest.approx(B, rel=0.2)


@pytest.mark.slow
def test_all_terms_of_the_whole_model_come_back_from_forty_units(tmp_path):
    """N within 3 %, B and K within 20 %, the correlation time known: standard errors 0.1 %, 6 % and 4 %."""
    np.save(tmp_path / "gyro.npy", _simulated(MTI, units=40, seed=7))
    known_s = MTI.gyro_bias_correlation_s
    found = allan_tool.report(
        tmp_path / "gyro.npy", SLOW_HZ, "rad/s", terms="NBK", bias_correlation_s=known_s
    ).parameters
    for key, within in (
        ("gyro_noise_density_rad_s_rthz", 0.03),
        ("gyro_bias_instability_rad_s", 0.2),
        ("gyro_rate_random_walk_rad_s_rts", 0.2),
    ):
        assert found[key] == pytest.approx(getattr(MTI, key), rel=within), key


def test_a_record_of_a_blink_says_that_it_tells_little(tmp_path):
    np.save(tmp_path / "gyro.npy", _white(n=999))
    assert "all terms are uncertain" in allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s").caution
    np.save(tmp_path / "gyro.npy", _white(n=1001))
    assert "all terms" not in allan_tool.report(tmp_path / "gyro.npy", 100.0, "rad/s").caution


def test_a_mark_for_a_missing_sample_is_no_rate(command, tmp_path):
    rates = _white()
    rates[100, 1] = 1e300
    np.save(tmp_path / "gyro.npy", rates)
    status, out, err = command("allan", tmp_path / "gyro.npy", "--rate-hz", "100", "--unit", "rad/s")
    assert (status, out) == (2, "") and "expected samples below 1e+09 in size, got 1e+300" in err


def test_a_record_is_not_written_over_by_its_own_sheet(command, tmp_path):
    record = tmp_path / "gyro.csv"
    np.savetxt(record, _white(), delimiter=",", header="x_rad_s,y_rad_s,z_rad_s", comments="")
    before = record.read_bytes()
    status, out, err = command("allan", record, "--rate-hz", "100", "--out", record)
    assert (status, out) == (2, "") and "--out: expected another file than the record" in err
    assert record.read_bytes() == before
