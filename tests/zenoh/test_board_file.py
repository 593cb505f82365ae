"""``[zenoh]`` of board files and routers: every mistake is named with its place."""

from pathlib import Path

import pytest

from tests.e2e.command import vbus
from vbus.board.config import read_board_text, read_zenoh_file
from vbus.boardfile.source import BoardFileError
from vbus.network.session import Network
from vbus.serve.serving import network_of

CHIP = '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
FILES = 'certificate = "a"\nkey = "b"\nauthority = "c"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[zenoh]\nlisten = ["7447"]\n', 'b.toml:6: zenoh.listen[1]: found "7447"; write "tcp/'),
        ('[zenoh]\nconnect = ["udp/a:1"]\n', 'zenoh.connect[1]: found "udp/a:1"; write "tcp/HOST'),
        ('[zenoh]\nlisten = ["tls/a:1"]\n', '"tls/a:1" needs certificates: give certificate, key'),
        (
            f'[zenoh]\nlisten = ["tcp/a:1"]\n{FILES}',
            '"tcp/a:1" lets hosts in that show no certificate; write "tls/a:1"',
        ),
        ('[zenoh]\nkey = "b"\n', 'zenoh.key: "key" needs "certificate" (PEM file of'),
        ('[zenoh.allow]\nme = ["x"]\n', "rights belong to names in certificates"),
        (
            f'[zenoh]\n{FILES}[zenoh.allow]\nme = ["/x/bus"]\n',
            'zenoh.allow.me[1]: found "/x/bus"; write a key below vbus/',
        ),
        (f"[zenoh]\n{FILES}[zenoh.allow]\nme = 3\n", "found 3; write a list of names"),
        ("[zenoh]\ngrace = 2\n", "zenoh.grace"),
        ("[zenoh]\nlissen = []\n", 'did you mean "listen"'),
        ('[[hosts]]\ntransport = "zenoh:x"\n', 'found "zenoh:x"; write "zenoh:" and nothing'),
        (
            '[[hosts]]\ntransport = "zenoh:"\nchips = ["x"]\n[[hosts]]\ntransport = "zenoh:"\n',
            "one entry serves any number of hosts",
        ),
    ],
)
def test_a_mistake_is_named_with_its_place_and_what_to_write(text: str, said: str) -> None:
    with pytest.raises(BoardFileError) as caught:
        read_board_text(CHIP + text, "b.toml")
    assert said in str(caught.value)


def test_a_router_reads_the_same_section_from_any_file(tmp_path: Path) -> None:
    file = tmp_path / "r.toml"
    file.write_text(
        f'[zenoh]\nlisten = ["tls/[::1]:7447"]\ngrace = "500 ms"\n{FILES}'
        '[zenoh.allow]\n"a b" = ["x/*/bus", "**"]\nnobody = []\n'
    )
    network = network_of(read_zenoh_file(file))
    assert network.listen == ("tls/[::1]:7447",)
    assert network.grace_seconds == 0.5
    assert network.security is not None
    assert network.security.certificate == "a"
    assert network.security.allow == {"a b": ("x/*/bus", "**"), "nobody": ()}

    file.write_text('[zenoh]\nlisten = ["nothing"]\n')
    with pytest.raises(BoardFileError, match=r'r.toml:2: zenoh.listen\[1\]: found "nothing"'):
        read_zenoh_file(file)


def test_without_the_section_nobody_outside_gets_in() -> None:
    file, _ = read_board_text(CHIP + '[[hosts]]\ntransport = "zenoh:"\n')
    assert network_of(file.zenoh) == Network()


def test_check_prints_what_each_name_may_do(tmp_path: Path) -> None:
    file = tmp_path / "b.toml"
    file.write_text(
        CHIP + '[[hosts]]\ntransport = "zenoh:"\n' + f"[zenoh]\n{FILES}[zenoh.allow]\n"
        'far = ["serve far/**"]\nme = ["x/*/bus"]\n'
    )
    done = vbus("check", file)
    assert done.returncode == 0
    assert f"{file}: zenoh: far: asks, hears, answers and publishes far/**" in done.stdout
    assert f"{file}: zenoh: me: asks and hears x/*/bus" in done.stdout
