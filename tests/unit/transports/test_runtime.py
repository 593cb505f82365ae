"""The runtime directory, and names in it."""

import os
import stat
from pathlib import Path

import pytest

from vbus.core.errors import NameInUseError, TransportError
from vbus.core.runtime import expanded, lock_of, lock_state, runtime_directory, subdirectory
from vbus.network.places import endpoints_at, register, router_place, unregister
from vbus.transports.runtime import NameLock


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A computer without /run, whose temporary directory is the test's."""
    real = os.access

    def access(path: str | Path, mode: int) -> bool:
        return not str(path).startswith("/run") and real(path, mode)

    monkeypatch.setattr(os, "access", access)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.delenv("VBUS_RUNTIME", raising=False)
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return tmp_path


def test_the_directory_may_be_given(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(places / "a" / "b"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places))
    assert runtime_directory() == places / "a" / "b"
    assert (places / "a" / "b").is_dir()


def test_else_it_lies_in_the_directory_of_the_users_session(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places))
    assert runtime_directory() == places / "vbus"


@pytest.mark.parametrize("variable", ["$VBUS_RUNTIME", "${VBUS_RUNTIME}"])
def test_its_variable_stands_for_it_where_the_environment_has_none(
    places: Path, monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places))
    assert expanded(f"{variable}/axis.sock") == str(places / "vbus" / "axis.sock")


@pytest.mark.parametrize("mine", ["/run/vbus", "/run"])
def test_else_it_is_that_of_the_system_where_it_can_be_written(
    places: Path, monkeypatch: pytest.MonkeyPatch, mine: str
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: str(path) == mine)
    monkeypatch.setattr("vbus.core.runtime._strict", lambda path: path)  # makes no folder in /run
    assert runtime_directory() == Path("/run/vbus")


def test_else_it_is_a_private_one_below_the_temporary_directory(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "not-there"))
    directory = runtime_directory()
    assert directory == places / f"vbus-{os.getuid()}"
    assert stat.S_IMODE(directory.stat().st_mode) == 0o700
    assert runtime_directory() == directory


def test_a_directory_that_others_may_enter_is_not_trusted(places: Path) -> None:
    directory = places / f"vbus-{os.getuid()}"
    directory.mkdir()
    directory.chmod(0o770)
    with pytest.raises(
        TransportError,
        match=rf"^runtime directory {directory} is open to others \(owner \w+, mode 770\);"
        r" remove it, or set VBUS_RUNTIME to one of your own$",
    ):
        runtime_directory()


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o1777])
def test_a_given_directory_that_others_may_write_in_is_refused(
    places: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    directory = places / "given"
    directory.mkdir()
    directory.chmod(mode)
    monkeypatch.setenv("VBUS_RUNTIME", str(directory))
    with pytest.raises(
        TransportError,
        match=rf"^runtime directory {directory} is open to others \(owner \w+, mode {mode:o}\):"
        r" make it yours and chmod go-w, or set VBUS_RUNTIME to one of your own$",
    ):
        runtime_directory()
    directory.chmod(0o755)
    assert runtime_directory() == directory


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a directory away")
def test_a_given_directory_of_somebody_else_is_refused(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = places / "given"
    directory.mkdir()
    os.chown(directory, 65534, 65534)
    monkeypatch.setenv("VBUS_RUNTIME", str(directory))
    with pytest.raises(TransportError, match=rf"^runtime directory {directory} is open to others"):
        runtime_directory()


def test_a_directory_that_others_may_replace_is_refused(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_to_all = places / "open"
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    monkeypatch.setenv("VBUS_RUNTIME", str(open_to_all / "mine"))
    with pytest.raises(
        TransportError, match=rf"others may replace it, .* write in {open_to_all} \(mode 777\)"
    ):
        runtime_directory()
    open_to_all.chmod(0o1777)
    assert runtime_directory() == open_to_all / "mine"


@pytest.mark.parametrize("name", ["boards", "zenoh"])
def test_a_link_in_the_place_of_a_folder_is_not_followed(
    places: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(places / "given"))
    elsewhere = places / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    (runtime_directory() / name).symlink_to(elsewhere)
    with pytest.raises(TransportError, match=rf"^runtime directory {places}/given/{name} is open"):
        subdirectory(name)


def test_a_lock_that_others_may_write_to_is_refused(tmp_path: Path) -> None:
    planted = lock_of(tmp_path / "x")
    planted.write_text("1\n")
    planted.chmod(0o666)
    with pytest.raises(TransportError, match=r"is no lock of vbus: others have made it or may"):
        NameLock(tmp_path / "x").take()
    assert planted.read_text() == "1\n"


def test_a_place_that_others_may_write_to_leads_nowhere(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(places))
    place = register(router_place(), ["tcp/127.0.0.1:1"])
    assert endpoints_at(place) == ("tcp/127.0.0.1:1",)
    place.chmod(0o666)
    assert endpoints_at(place) == ()
    place.chmod(0o600)
    link = place.with_name("link.board")
    link.symlink_to(place)
    assert endpoints_at(link) == ()
    unregister(place)


def test_a_place_that_cannot_be_written_leaves_nothing_behind(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(places))
    place = router_place()
    place.mkdir()
    open_before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(OSError, match="directory"):
        register(place, ["tcp/127.0.0.1:1"])
    assert list(place.parent.iterdir()) == [place]
    assert len(os.listdir("/proc/self/fd")) == open_before


def test_a_link_laid_by_somebody_else_is_not_followed(places: Path) -> None:
    elsewhere = places / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    (places / f"vbus-{os.getuid()}").symlink_to(elsewhere)
    with pytest.raises(TransportError, match=r"is open to others"):
        runtime_directory()


def test_a_directory_that_cannot_be_made_says_why(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (places / "file").write_text("")
    monkeypatch.setenv("VBUS_RUNTIME", str(places / "file" / "x"))
    with pytest.raises(
        TransportError, match=rf"^runtime directory {places}/file/x: Not a directory$"
    ):
        runtime_directory()


def test_a_name_has_one_owner_at_a_time(tmp_path: Path) -> None:
    first, second = NameLock(tmp_path / "x"), NameLock(tmp_path / "x")
    first.take()
    with pytest.raises(
        NameInUseError, match=rf"^{tmp_path}/x is in use by process {os.getpid()}; stop it or"
    ):
        second.take()
    first.give_back()
    second.take()
    second.give_back()
    assert list(tmp_path.iterdir()) == []


def test_looking_at_locks_holds_no_descriptor(tmp_path: Path) -> None:
    lock = NameLock(tmp_path / "x")
    lock.take()
    before = len(os.listdir("/proc/self/fd"))
    assert lock_state(tmp_path / "x")[0]
    assert len(os.listdir("/proc/self/fd")) == before
    lock.give_back()


def test_a_lock_left_by_a_process_that_died_is_taken_over(tmp_path: Path) -> None:
    (tmp_path / ".x.lock").write_text("12345\n")
    lock = NameLock(tmp_path / "x")
    lock.take()
    assert (tmp_path / ".x.lock").read_text() == f"{os.getpid()}\n"
    lock.give_back()


@pytest.mark.parametrize("how", ["symlink", "hard link", "pipe"])
def test_a_lock_that_leads_elsewhere_is_refused_and_nothing_is_overwritten(
    tmp_path: Path, how: str
) -> None:
    precious = tmp_path / "precious"
    precious.write_text("of somebody else")
    planted = lock_of(tmp_path / "x")
    if how == "symlink":
        planted.symlink_to(precious)
    elif how == "hard link":
        planted.hardlink_to(precious)
    else:
        os.mkfifo(planted)
    with pytest.raises(TransportError, match=r"is no lock of vbus: it leads elsewhere"):
        NameLock(tmp_path / "x").take()
    assert precious.read_text() == "of somebody else"


def test_a_pipe_in_the_place_of_a_lock_keeps_nobody_waiting(tmp_path: Path) -> None:
    os.mkfifo(lock_of(tmp_path / "x"))
    assert lock_state(tmp_path / "x") == (False, "")
