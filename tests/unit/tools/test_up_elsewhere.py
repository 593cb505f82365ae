"""A machine written down: compose files and units, and what cannot be written."""

import configparser
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from vbus.board.config import read_board_file, read_board_text
from vbus.board.sections import BoardFile
from vbus.errors import ConfigError, VbusError
from vbus.tools import up_elsewhere
from vbus.tools.up import _write
from vbus.version import __version__

DOCKER = Path(__file__).parents[3] / "docker"
DEMO = DOCKER / "demo" / "three_axes.toml"
PINNED = f"registry.example/vbus@sha256:{'5e' * 32}"
TEXT = DEMO.read_text()
AXES = ("x", "y", "z")


def machine(*changes: tuple[str, str]) -> BoardFile:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return read_board_text(text, "machine.toml")[0]


def composed(file: BoardFile, image: str = PINNED) -> dict[str, object]:
    made = up_elsewhere.compose(file, "machine.toml", up_elsewhere.images_of(file, image, False))
    found: dict[str, object] = YAML(typ="safe").load(made.files["compose.yaml"])
    return found


def test_the_compose_file_of_the_images_folder_is_the_generated_one(tmp_path: Path) -> None:
    shutil.copytree(DOCKER / "demo", tmp_path / "demo")
    file, _ = read_board_file(DEMO)
    _write(file, str(tmp_path / "demo" / DEMO.name), "compose", tmp_path, "vbus", unpinned=True)
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"demo", "compose.yaml"}
    assert (tmp_path / "compose.yaml").read_text() == (DOCKER / "compose.yaml").read_text()


def test_nodes_that_share_a_process_are_one_service() -> None:
    file = machine(
        ("[nodes.x]\n[nodes.y]", '[nodes.x]\nprocess = "both"\n[nodes.y]\nprocess="both"')
    )
    services = composed(file)["services"]
    assert isinstance(services, dict)
    assert list(services) == ["router", "both", "z"]
    command = services["both"]["command"]
    assert command == ["run", "/boards/machine.toml", "--node", "x", "--node", "y"]


def test_images_come_from_the_file_and_an_option_stands_above_it() -> None:
    other = PINNED.replace("5e", "a1")
    file = machine(*((f"[nodes.{axis}]", f'[nodes.{axis}]\nimage = "{other}"') for axis in AXES))
    images = up_elsewhere.images_of(file, "", unpinned=False)
    assert images == dict.fromkeys((*AXES, "router"), other)
    assert set(up_elsewhere.images_of(file, PINNED, unpinned=False).values()) == {PINNED}


@pytest.mark.parametrize(
    "image", ["vbus", "vbus:0.1.0", "vbus@sha256:5e5e", f"vbus@sha256:{'5E' * 32}", "@sha256:"]
)
def test_an_image_without_its_digest_is_refused_unless_that_is_meant(image: str) -> None:
    with pytest.raises(ConfigError, match="may be another image tomorrow"):
        up_elsewhere.images_of(machine(), image, unpinned=False)
    assert up_elsewhere.images_of(machine(), image, unpinned=True)["x"] == image


def test_an_image_that_nobody_has_named_is_asked_for() -> None:
    with pytest.raises(ConfigError, match="which image has node x"):
        up_elsewhere.images_of(machine(), "", unpinned=True)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"tcp/router:7447"', '"tcp/127.0.0.1:7447"'), "is each container's own; write connect"),
        (('"tcp/router:7447"', '"tcp/x:7447"'), 'the node "x" would be one container'),
        (('connect = ["tcp/router:7447"]', ""), "where do the nodes meet"),
        (("[nodes.x]", '[nodes.x]\nlisten = "tcp/127.0.0.1:1"'), 'write "tcp/x:1"'),
    ],
)
def test_containers_that_could_not_meet_are_refused(change: tuple[str, str], said: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(said)):
        composed(machine(change))


def test_a_node_that_listens_needs_no_router() -> None:
    file = machine(
        ("[nodes.x]", '[nodes.x]\nlisten = "tcp/x:7447"'),
        ('connect = ["tcp/router:7447"]', "remote = true"),
    )
    services = composed(file)["services"]
    assert isinstance(services, dict)
    assert list(services) == list(AXES)
    assert "depends_on" not in services["y"]


def test_a_port_that_shall_be_reached_is_published_on_the_loopback_alone() -> None:
    first = '[[hosts]]\ntransport = "zenoh:"\nchips = ["x"]'
    wide = first.replace('"zenoh:"', '"tcp:0.0.0.0:7000"\nremote = true')
    found = composed(machine((first, wide)))
    assert found["services"]["x"]["ports"] == ["127.0.0.1:7000:7000"]  # type: ignore[index]
    assert found["networks"] == {"machine": {"internal": False}}
    near = machine((first, first.replace('"zenoh:"', '"tcp:7000"')))
    made = up_elsewhere.compose(near, "machine.toml", up_elsewhere.images_of(near, "v", True))
    assert "ports" not in made.files["compose.yaml"]
    assert [notice.partition(";")[0] for notice in made.notices] == [
        "tcp:7000 is reached within the container of x alone"
    ]


def test_a_serial_device_is_no_part_of_a_container() -> None:
    first = '[[hosts]]\ntransport = "zenoh:"\nchips = ["x"]'
    file = machine((first, first.replace("zenoh:", "serial:/dev/ttyS9")))
    with pytest.raises(VbusError, match="is a device of one computer; run node x there"):
        composed(file)


def test_a_router_elsewhere_is_left_to_others() -> None:
    file = machine(("tcp/router:7447", "tcp/192.0.2.7:7447"))
    made = up_elsewhere.compose(file, "m.toml", up_elsewhere.images_of(file, PINNED, False))
    assert "192.0.2.7:7447 is not part of this" in made.notices[0]
    found = YAML(typ="safe").load(made.files["compose.yaml"])
    assert list(found["services"]) == list(AXES)
    assert found["networks"] == {"machine": {"internal": False}}


# -- units -------------------------------------------------------------------------------------


def test_units_start_each_process_tell_when_it_is_ready_and_belong_to_one_target() -> None:
    files = up_elsewhere.systemd(machine(), "machine.toml").files
    services = [f"vbus-machine-{name}.service" for name in ("router", *AXES)]
    assert list(files) == [*services, "vbus-machine.target", "requirements.txt"]
    for name in files:
        if name == "requirements.txt":
            continue
        unit = configparser.ConfigParser(interpolation=None, comment_prefixes="#")
        unit.optionxform = str  # type: ignore[assignment,method-assign]
        unit.read_string(files[name])
        if name.endswith(".target"):
            assert unit["Unit"]["Wants"].split() == services
            continue
        assert unit["Service"]["Type"] == "notify"
        assert unit["Unit"]["PartOf"] == unit["Install"]["WantedBy"] == "vbus-machine.target"
        assert ("vbus-machine-router.service" in unit["Unit"]["After"]) == ("router" not in name)
    y = files["vbus-machine-y.service"]
    assert "\nExecStart=/opt/vbus/bin/vbus run /etc/vbus/machine.toml --node y\n" in y
    router = files["vbus-machine-router.service"]
    assert "/opt/vbus/bin/vbus router --listen tcp/0.0.0.0:7447 --remote\n" in router
    wanted = files["requirements.txt"].splitlines()[2:]
    assert wanted[0] == f"vbus=={__version__}"
    assert [line.partition("==")[0] for line in wanted[1:]].count("eclipse-zenoh") == 1
    assert all(re.fullmatch(r"[\w.-]+==\S+", line) for line in wanted)


def test_a_router_of_this_computer_alone_listens_there_alone() -> None:
    files = up_elsewhere.systemd(machine(("tcp/router", "tcp/127.0.0.1")), "m.toml").files
    assert "router --listen tcp/127.0.0.1:7447\n" in files["vbus-machine-router.service"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not here")
def test_systemd_takes_the_units(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(up_elsewhere, "PROGRAM", "/bin/true")
    files = up_elsewhere.systemd(machine(), "machine.toml").files
    units = [name for name in files if name != "requirements.txt"]
    for name in units:
        (tmp_path / name).write_text(files[name])
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *(f"./{name}" for name in units)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_another_board_file_in_the_folder_is_not_written_over(tmp_path: Path) -> None:
    file, _ = read_board_file(DEMO)
    (tmp_path / "machine.toml").write_text("# mine\n")
    with pytest.raises(VbusError, match="another board file is there"):
        _write(file, str(DEMO), "systemd", tmp_path, "", unpinned=False)
    assert [path.name for path in tmp_path.iterdir()] == ["machine.toml"]
