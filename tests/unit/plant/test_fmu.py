"""Units of FMI as plants: the carriage of unit.c, built for both versions of FMI."""

import logging
import re
import subprocess
import zipfile
from pathlib import Path

import pytest

from tests.boards import AXIS
from vbus.board.build import load_board_text
from vbus.board.snapshot import restore, take
from vbus.core.errors import ConfigError, PluginError, SnapshotError
from vbus.core.state import load, save
from vbus.plant.fmu import FmuPlant
from vbus.testing import check_plant

fmpy = pytest.importorskip("fmpy")

HERE = Path(__file__).parent
TWO = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="carriage" guid="1">
<CoSimulation modelIdentifier="carriage" canHandleVariableCommunicationStepSize="true"
 canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
<ModelVariables>
<ScalarVariable name="drive" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="x" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="parameter" variability="fixed">
<Real start="1"/></ScalarVariable>
<ScalarVariable name="wall" valueReference="3" causality="parameter" variability="fixed">
<Real start="1e9"/></ScalarVariable>
<ScalarVariable name="b" valueReference="5" causality="input"><Real start="0"/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>"""
THREE = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="carriage" instantiationToken="1">
<CoSimulation modelIdentifier="carriage" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<Float64 name="drive" valueReference="0" causality="input" start="0"/>
<Float64 name="x" valueReference="1" causality="output"/>
<Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
<Float64 name="gain" valueReference="2" causality="parameter" variability="fixed" start="1"/>
<Float64 name="b" valueReference="5" causality="input" start="0"/>
</ModelVariables><ModelStructure><Output valueReference="1"/></ModelStructure>
</fmiModelDescription>"""
BOARD = AXIS.format(time="lockstep", model="fmu:{}") + 'position = "x"\ncounts_per_unit = 20000\n'


@pytest.fixture(scope="session")
def units(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("units")
    headers = Path(fmpy.__file__).parent / "c-code"
    made = []
    for version, text, place in ((2, TWO, "linux64"), (3, THREE, "x86_64-linux")):
        library = folder / f"carriage{version}.so"
        # A unit has every function of the standard; the others return an error.
        header = (headers / f"fmi{version}Functions.h").read_text()
        every = set(re.findall(rf"#define (fmi{version}\w+) +fmi{version}FullName", header))
        rest = every - set(re.findall(r"\w+", (HERE / "unit.c").read_text()))
        stubs = folder / f"stubs{version}.c"
        stubs.write_text("".join(f"int {name}(void) {{ return 3; }}\n" for name in sorted(rest)))
        subprocess.run(
            ["gcc", "-shared", "-fPIC", "-O1", f"-DFMI={version}", "-I", str(headers),
             str(HERE / "unit.c"), str(stubs), "-o", str(library)],
            check=True, timeout=60,
        )  # fmt: skip
        made.append(folder / f"carriage{version}.fmu")
        with zipfile.ZipFile(made[-1], "w") as archive:
            archive.writestr("modelDescription.xml", text)
            archive.write(library, f"binaries/{place}/carriage.so")
    return made


def settings(unit: Path, **more: float | str) -> dict[str, float | str]:
    return {"file": str(unit), "position": "x", "counts_per_unit": 20_000.0, **more}


@pytest.mark.parametrize("version", [0, 1])
def test_both_versions_move_alike_and_the_same_in_every_run(
    units: list[Path], version: int
) -> None:
    def course(unit: Path) -> list[int]:
        plant = FmuPlant(settings(unit, start="gain=2.5", step=64_000_000))
        plant.prepare(256e-6)
        return [plant.drive(0.5 if n < 40 else -0.25, 0) for n in range(80)]

    first = course(units[version])
    assert first == course(units[version]) == course(units[0])
    assert first[-1] < max(first) > 100


def test_a_unit_that_is_not_driven_stays_at_the_count_it_began_at(units: list[Path]) -> None:
    plant = FmuPlant(settings(units[0]))
    plant.prepare(256e-6)
    assert [plant.drive(0.0, 0) for _ in range(5)] == [0] * 5


@pytest.mark.parametrize("takes", ["drive", "pulses", "phases"])
def test_a_unit_keeps_the_contract_of_plants(units: list[Path], takes: str) -> None:
    drive = "drive, b" if takes == "phases" else "drive"
    check_plant(lambda: FmuPlant(settings(units[0], takes=takes, drive=drive)), periods=120)


def test_step_pulses_are_the_place_they_lead_to_and_phases_an_input_each(units: list[Path]) -> None:
    def driven(**given: float | str) -> tuple[FmuPlant, list[float]]:
        plant = FmuPlant(settings(units[0], step=64_000_000, **given))
        plant.prepare(256e-6)
        taken: list[float] = []
        put = plant._fmu.setReal
        plant._fmu.setReal = lambda at, values: (taken.extend(values), put(at, values))
        return plant, taken

    plant, taken = driven(takes="pulses", full_drive=0.5)
    plant.pulses(8)
    plant.pulses(-3)
    # Pulse j of n comes at j/n of the period: after quarters of it 2, 4, 6, 8, then 0, -1, -2, -3.
    assert taken == [1.0, 2.0, 3.0, 4.0, 4.0, 3.5, 3.0, 2.5]
    plant, taken = driven(takes="phases", drive="drive,b", full_drive=2.0)
    assert plant.phases(0.5, -0.25, 0.125) == 0
    assert taken == [1.0, -0.5] * 4


@pytest.mark.parametrize(
    ("part", "takes", "says"),
    [
        ("MC1141A", "phases", ""),
        ("MCP-1200", "pulses", ""),
        ("MC1141A", "pulses", "gives phase commands; this plant takes step pulses"),
        ("LM629N-8", "phases", "gives servo commands; this plant takes phase commands"),
        ("MC1141A", "drive", "gives phase commands; this plant takes servo commands"),
    ],
)
def test_a_chip_drives_a_unit_that_takes_what_it_gives(
    units: list[Path], part: str, takes: str, says: str
) -> None:
    drive = "drive, b" if takes == "phases" else "drive"
    text = BOARD.format(units[0]).replace("LM629N-8", part)
    text += f'takes = "{takes}"\ndrive = "{drive}"\n'
    if says:
        with pytest.raises(ConfigError, match=says):
            load_board_text(text)
    else:
        plant = load_board_text(text).axes["x.1"]
        assert (takes,) == plant.TAKES


def test_a_step_longer_than_a_period_is_made_when_it_ends(units: list[Path]) -> None:
    plant = FmuPlant(settings(units[0], step=1_000_000_000))
    plant.prepare(256e-6)
    counts = [plant.drive(1.0, 0) for _ in range(16)]
    assert [n for n in range(1, 16) if counts[n] != counts[n - 1]] == [3, 7, 11, 15]
    assert counts[0] == 0


def test_a_unit_that_fails_stands_and_says_so(
    units: list[Path], caplog: pytest.LogCaptureFixture
) -> None:
    plant = FmuPlant(settings(units[0], start="wall=0.05"))
    plant.prepare(1e-3)
    with caplog.at_level(logging.ERROR):
        counts = [plant.drive(1.0, 0) for _ in range(200)]
    assert counts[-1] == counts[-50] < 0.05 * 20_000
    (record,) = caplog.records
    assert "failed: fmi2DoStep" in record.getMessage()
    assert "the shaft stands from now on" in record.getMessage()


def test_a_unit_without_states_refuses_to_be_saved_and_to_go_back(units: list[Path]) -> None:
    board = load_board_text(BOARD.format(units[1]))
    with pytest.raises(SnapshotError, match=r"axis x.1: .*3.fmu cannot .* lacks canGetAndSetFMUst"):
        take(board)
    assert board.state_hash()  # of a journal's end
    plant = FmuPlant(settings(units[1]))
    plant.prepare(256e-6)
    with pytest.raises(ValueError, match="cannot be saved or go back"):
        load(plant, save(plant))


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"file": ""}, 'write model = "fmu:FILE.fmu"'),
        ({"file": "nowhere.fmu"}, "nowhere.fmu: this unit cannot be used: .*No such file"),
        ({"position": "y"}, 'has no output "y" that is a number; there are x'),
        ({"drive": "gain"}, 'has no input "gain" that is a number; there are drive, b'),
        ({"start": "mass=1"}, '"mass=1" is no number of a variable .* drive, x, gain, wall, b'),
        ({"start": "gain=big"}, '"gain=big" is no number'),
        ({"takes": "phases"}, 'drive = "drive": phase commands go to 2 or 3 inputs of a unit;'),
        ({"drive": "drive, b"}, 'drive = "drive, b": servo commands go to 1 inputs of a unit;'),
        ({"takes": "phases", "drive": "drive, c"}, 'no input "c" that is a number; there are dri'),
    ],
)
def test_a_unit_that_does_not_fit_is_refused(
    units: list[Path], given: dict[str, str], says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        FmuPlant({**settings(units[0]), **given})


def test_a_board_has_the_unit_of_its_model_and_goes_back(units: list[Path]) -> None:
    board = load_board_text(BOARD.format(units[0]))
    port = board.open_port("h")
    for byte in (0x1E, 0x00, 0x0A, 0x01, 0x2C, 0x07, 0xD0):
        port.delay(10**8)
        port.write(int(byte != 0x1E), byte)
    assert board.axes["x.1"].settings["file"] == str(units[0])
    snapshot = take(board)
    assert f"fmu:{units[0]}" in snapshot.text
    port.delay(10**10)
    later = take(board).digest
    restore(board, snapshot)
    board.ports[0].delay(10**10)
    assert take(board).digest == later


def test_a_model_without_a_file_takes_none() -> None:
    with pytest.raises(ConfigError, match='"dc_motor" has no file; write model = "dc_motor"'):
        load_board_text(AXIS.format(time="lockstep", model="dc_motor:x"))


def test_what_is_missing_is_named(units: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "fmpy", None)
    with pytest.raises(PluginError, match=r"pip install 'vbus\[fmi\]'"):
        FmuPlant(settings(units[0]))
