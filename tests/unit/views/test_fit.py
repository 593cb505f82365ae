"""``vbus fit``: numbers of a motor that was made up, from what its encoder has shown."""

from __future__ import annotations

import json
import math
import random
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.boards import AXIS
from tests.unit.views.conftest import lm629_command, record
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.cli.test.fit import command
from vbus.core.errors import CaptureError, VbusError
from vbus.core.kernel import MS, US
from vbus.plant.dc_motor import DcMotor
from vbus.views.fit.fit import Fit, MotorFit
from vbus.views.fit.moves import Driven, RecordedMove, capture_move, table_move
from vbus.views.silicon.capture import Capture

BOARD = AXIS.format(time="lockstep", model="dc_motor")
TRUE = {
    "inertia": 9e-6, "torque_constant": 0.035, "back_emf": 0.035, "viscous_friction": 2e-5,
    "coulomb_friction": 0.003, "static_friction": 0.00375, "load_torque": 0.001,
}  # fmt: skip
UNITS = {
    "inertia": "kg*m^2", "torque_constant": "N*m/A", "back_emf": "V*s",
    "viscous_friction": "N*m*s", "coulomb_friction": "N*m", "static_friction": "N*m",
    "load_torque": "N*m",
}  # fmt: skip


def made_up(
    seed: int, true: dict[str, float], seconds: float = 0.12, low: float = -1.0,
    current: bool = False, period: float = 500e-6,
) -> RecordedMove:  # fmt: skip
    """Drive a motor at random and read its encoder through noise."""
    rng = random.Random(seed)
    motor = DcMotor(true)
    motor.prepare(period)
    drive = [0.0] * 3
    while len(drive) < seconds / period:
        drive += [rng.uniform(low, 1.0)] * int(rng.uniform(0.01, 0.03) / period)
    phase = rng.random()
    steps = []
    for level in drive:
        motor.drive(level, 0)
        count = math.floor(motor.place + phase - 0.5 + rng.gauss(0, 0.4))
        amps = round((motor.current + rng.gauss(0, 0.02)) * 100) / 100
        steps.append(Driven(period, level, count, amps if current else None))
    return RecordedMove(0, steps)


def fitted(move: RecordedMove, **given: float) -> Fit:
    return MotorFit(given, move.cut("made up"), "made up").fit()


@pytest.mark.parametrize("seed", range(4))
def test_what_a_noisy_run_tells_is_within_two_percent(seed: int) -> None:
    current = bool(seed % 2)
    rng = random.Random(seed)
    true = {name: value * rng.uniform(0.5, 2) for name, value in TRUE.items()}
    true["back_emf"] = true["torque_constant"] = 0.03 * (rng.uniform(0.8, 1.3) if current else 1)
    true["static_friction"] = 1.25 * true["coulomb_friction"]
    fit = fitted(made_up(seed, true, current=current))
    told = [one for one in fit.found if one.sure]
    assert "inertia" in {one.name for one in told}
    for one in told:
        size = true["coulomb_friction"] if one.name == "load_torque" else true[one.name]
        assert abs(one.value - true[one.name]) <= 0.02 * size, one
    assert fit.rms < 0.8
    assert ("torque_constant" in fit.held) == (not current)


def test_without_a_current_inertia_is_known_beside_the_torque_constant() -> None:
    fit = fitted(made_up(7, TRUE), torque_constant=0.035, back_emf=0.035)
    ((title, value, error, _),) = fit.ratios
    assert title == "inertia / torque_constant"
    assert abs(value - 9e-6 / 0.035) < 3 * error < 0.02 * value
    assert fit.held == ["torque_constant", "back_emf"]
    assert any("no current was recorded" in note for note in fit.notes)


def test_a_run_that_never_turns_back_cannot_tell_dry_friction_from_load() -> None:
    fit = fitted(made_up(3, TRUE, low=0.3), torque_constant=0.035, back_emf=0.035)
    by_name = {one.name: one for one in fit.found}
    assert by_name["inertia"].sure
    for name in ("coulomb_friction", "load_torque"):
        assert not by_name[name].sure
        assert "never turns back" in by_name[name].why


def test_a_run_shorter_than_the_time_constant_says_so() -> None:
    move = made_up(5, {**TRUE, "inertia": 1e-4}, seconds=0.05, period=250e-6)
    fit = fitted(move, inertia=1e-4, torque_constant=0.035, back_emf=0.035)
    assert any("mechanical time constant" in one.why for one in fit.found if not one.sure)


def test_a_search_that_has_not_settled_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vbus.views.fit.fit.MOST_ROUNDS", 3)
    monkeypatch.setattr("vbus.views.fit.fit.SEARCHES", 1)
    monkeypatch.setattr("vbus.views.fit.fit.ASTRAY", 1e30)
    fit = fitted(made_up(0, TRUE), inertia=9e-5)
    assert not any(one.sure for one in fit.found)
    assert any("the search has not settled" in one.why for one in fit.found)


def test_another_motor_than_the_files_is_noticed() -> None:
    fit = fitted(made_up(1, TRUE), encoder_lines=100)
    assert any("encoder_lines" in note for note in fit.notes)


@pytest.mark.parametrize(
    ("move", "says"),
    [
        (RecordedMove(0, [Driven(1e-3, 0.5, 0)] * 100), "moves by 0 counts"),
        (RecordedMove(0, [Driven(1e-3, 0.0, 9 * n) for n in range(99)]), "begin at rest"),
        (
            RecordedMove(0, [Driven(1e-3, 0.0, 0), *(Driven(1e-3, 0.5, n) for n in range(30_000))]),
            "at most 20000",
        ),
    ],
)
def test_a_run_of_no_use_is_refused(move: RecordedMove, says: str) -> None:
    with pytest.raises(VbusError, match=says):
        move.cut("run")


def test_a_motor_that_cannot_turn_is_refused() -> None:
    with pytest.raises(VbusError, match="goes nowhere"):
        fitted(made_up(1, TRUE), torque_constant=0.0)


def test_a_table_is_read_with_units_volts_and_rows_that_are_missing() -> None:
    move = table_move(
        ["time (ms);volts;counts", "0;0;5", "1;12;5", "2;12;9", "4;-6;30", "5;0;40"], "t", 24.0
    )
    assert move == RecordedMove(5, [
        Driven(pytest.approx(1e-3), 0.0, 5), Driven(pytest.approx(1e-3), 0.5, 9),
        Driven(pytest.approx(1e-3), 0.5, None), Driven(pytest.approx(1e-3), 0.5, 30),
        Driven(pytest.approx(1e-3), -0.25, 40),
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "line 1: the columns are missing"),
        ("time,counts\n0,1", "line 1: the columns are time, counts"),
        ("time,pwm,counts\n0,0,1\n1,x,2", "line 3: .* is none"),
        ("time,pwm,counts\n0,0,1\n1,50,2", "line 3: a command of 50"),
        ("time,pwm,counts\n0,0,1\n1,0,2\n1,0,3", "time stands"),
        ("time,pwm,counts\n0,0,1\n1,0,2\n2,0,3\n3.4,0,3\n4,0,3", "line 5: .* not evenly"),
        ("time,pwm,counts\n0,0,1\n1,0,2", "2 rows"),
    ],
)
def test_a_table_that_is_none_is_refused(text: str, says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        table_move(text.splitlines(), "t", 24.0)


def test_a_capture_of_pwm_and_encoder_is_a_move() -> None:
    up = [0b0000, 0b0100, 0b1100, 0b1000]  # B, A, sign, pwm
    samples = [(0, 0), (10 * US, 0b01), (60 * US, 0), (100 * US, 0b11)]
    samples += [(200 * US + n * US, 0b11 | up[-n % 4]) for n in range(1, 8)]
    samples += [(300 * US, up[1] | 0b11), (400 * US, up[1])]
    wires = {"pwm": "p", "sign": "s", "a": "A", "b": "B"}
    move = capture_move(Capture(["p", "s", "A", "B"], 0, iter(samples)), "c", wires, 100 * US)
    assert move == RecordedMove(
        0,
        [
            Driven(1e-4, 0.5, 0),
            Driven(1e-4, -1.0, 0),
            Driven(1e-4, -1.0, -7),
            Driven(1e-4, -1.0, -7),
        ],
    )
    with pytest.raises(CaptureError, match="a: its channel is not given; give it with --map"):
        capture_move(Capture(["p"], 0, iter(samples)), "c", {"pwm": "p"}, 100 * US)
    jump = [(0, 0), (1, 0b1100)]
    with pytest.raises(CaptureError, match="1 ps: both channels"):
        capture_move(Capture(["p", "s", "A", "B"], 0, iter(jump)), "c", wires, 100 * US)


def there_and_back(port: HostBus) -> None:
    """Move an axis by 2000 counts, and back."""
    port.delay(1)
    lm629_command(port, 0x1E, 0x000A, 300, 2000)
    lm629_command(port, 0x04)
    for high, low in ((0, 2000), (0, 0)):
        lm629_command(port, 0x1F, 0x002A, 0, 3000, 16, 0, high, low)
        lm629_command(port, 0x01)
        port.delay(100 * MS)


def test_the_verb_fits_a_journal_and_prints_lines_for_the_board_file(tmp_path: Path) -> None:
    board, run = tmp_path / "axis.toml", tmp_path / "run.vbj"
    board.write_text(BOARD + 'torque_constant = "0.035 N*m/A"\nback_emf = "0.035 V*s"\n')
    true = {name: f'"{value} {UNITS[name]}"' for name, value in TRUE.items()}
    run.write_bytes(
        record(BOARD + "".join(f"{name} = {value}\n" for name, value in true.items()),
               there_and_back)
    )  # fmt: skip
    done = CliRunner().invoke(command, [str(board), str(run), "--no-progress"])
    assert done.exit_code == 0, done.output
    lines = done.output.splitlines()
    assert lines[1] == "[plants.motor]"
    printed = tomllib.loads(done.output)["plants"]["motor"]
    assert float(printed["inertia"].split()[0]) == pytest.approx(9e-6, rel=0.02)
    assert load_board_text(BOARD + "\n".join(lines[2:])).axes["x.1"].settings["inertia"] > 8e-6
    found = json.loads(CliRunner().invoke(command, [str(board), str(run), "--json"]).output)
    assert (found["axis"], found["plant"], found["held"]) == (
        "x.1", "motor", ["torque_constant", "back_emf"],
    )  # fmt: skip
    for one in found["found"]:
        assert abs(one["value"] - TRUE[one["name"]]) <= 2 * one["error"]
    assert "inertia" in {one["name"] for one in found["found"] if one["sure"]}


def test_the_verb_says_what_it_cannot_use(tmp_path: Path) -> None:
    board, table = tmp_path / "axis.toml", tmp_path / "run.csv"
    board.write_text(BOARD)
    table.write_text("time,pwm,counts\n0,0,0\n1,0,0\n2,0,0\n")
    for arguments, says in (
        (["--axis", "y"], '"y.1" is no axis with a dc_motor; its axes with one are x.1'),
        (["--map", "z=D0"], 'found "z=D0"; write SIGNAL=CHANNEL; signals are pwm, sign, a, b'),
        ([], "moves by 0 counts"),
    ):
        done = CliRunner().invoke(command, [str(board), str(table), *arguments])
        assert done.exit_code
        assert says in f"{done.output}{done.exception}"
    run = tmp_path / "run.vbj"
    run.write_bytes(record(BOARD.replace("chips.x", "chips.z"), lambda port: port.delay(MS)))
    done = CliRunner().invoke(command, [str(board), str(run)])
    assert "its board has no motor that takes a drive at axis x.1" in str(done.exception)
    assert "z.1" in str(done.exception)
