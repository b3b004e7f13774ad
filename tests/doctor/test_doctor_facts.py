"""Facts found on real files, ports and sockets, and on trees that look like Linux's."""

import grp
import http.server
import os
import pwd
import select
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dnb_edge.config.devices import RecordConfig
from dnb_edge.display import protocol
from dnb_edge.doctor import disk_facts, machine_facts, service_facts, unit_facts
from dnb_edge.doctor.access import access_of
from dnb_edge.doctor.usb_facts import usb_of
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.record.durable import DurableFile

Plant = Callable[[dict[str, str]], Path]
MINE = pwd.getpwuid(os.geteuid()).pw_name
MY_GROUP = grp.getgrgid(os.getegid()).gr_name


def test_whose_a_node_is(tmp_path: Path) -> None:
    """Group and mode are the node's; the service's groups are its user's and its unit's."""
    node = tmp_path / "video0"
    node.touch()
    node.chmod(0o660)
    found = access_of(node, user=MINE, unit_groups=("video",))
    assert (found.group, found.group_may, found.may_open) == (MY_GROUP, True, True)
    assert found.service_groups is not None
    assert {MY_GROUP, "video"} <= found.service_groups
    node.chmod(0o600)
    assert not access_of(node).group_may
    assert access_of(node, user="nobody-of-that-name").service_groups is None


USB = "sys/devices/pci0/usb1"


def usb_tree(plant: Plant, *, speed: str = "480", ports: str = "4") -> Path:
    """A camera and a microphone behind a hub, a disk and another bus with a second camera; `ports` of the root hub."""
    camera = f"{USB}/1-1/1-1.3"
    root = plant(
        {
            f"{USB}/busnum": "1", f"{USB}/bDeviceClass": "09", f"{USB}/product": "xHCI", f"{USB}/maxchild": ports,
            f"{USB}/1-1/busnum": "1", f"{USB}/1-1/bDeviceClass": "09", f"{USB}/1-1/product": "Acme hub",
            f"{camera}/busnum": "1", f"{camera}/speed": speed, f"{camera}/product": "Acme Webcam",
            f"{camera}/bDeviceClass": "ef", f"{camera}/1-1.3:1.0/bInterfaceClass": "0e",
            f"{USB}/1-1/1-1.4/busnum": "1", f"{USB}/1-1/1-1.4/product": "Mic", f"{USB}/1-1/1-1.4/bDeviceClass": "00",
            f"{USB}/1-1/1-1.4/1-1.4:1.0/bInterfaceClass": "01",
            f"{USB}/1-2/busnum": "1", f"{USB}/1-2/bDeviceClass": "00", f"{USB}/1-2/1-2:1.0/bInterfaceClass": "08",
            f"{USB}/1-3/busnum": "1", f"{USB}/1-3/product": "Mouse", f"{USB}/1-3/1-3:1.0/bInterfaceClass": "03",
            "sys/devices/pci0/usb2/2-1/busnum": "2", "sys/devices/pci0/usb2/2-1/2-1:1.0/bInterfaceClass": "0e",
        }
    )  # fmt: skip
    node = root / "sys/dev/char/81:0"
    node.mkdir(parents=True)
    (node / "device").symlink_to(root / camera / "1-1.3:1.0")
    return root


def test_a_camera_on_usb(plant: Plant) -> None:
    """Its speed, the hubs above it, and what on its own bus takes much of it: no mouse, no hub, nothing of another bus."""
    found = usb_of((81, 0), sys=usb_tree(plant) / "sys")
    assert found is not None
    assert (found.product, found.speed_mbps, found.hubs) == ("Acme Webcam", 480.0, ("Acme hub",))
    assert {(one.product, one.kinds) for one in found.neighbours} == {("Mic", ("sound",)), ("1-2", ("disk",))}


def test_a_hub_inside_the_machine_is_none(plant: Plant) -> None:
    """A Raspberry Pi 4 has all its sockets behind a hub on its root hub's only port: nobody can plug past that one."""
    found = usb_of((81, 0), sys=usb_tree(plant, ports="1") / "sys")
    assert found is not None
    assert found.hubs == ()


def test_a_camera_that_is_on_no_usb(plant: Plant) -> None:
    """A board's own camera, and a node that the kernel does not know."""
    root = plant({"sys/devices/platform/csi/name": "csi"})
    node = root / "sys/dev/char/81:1"
    node.mkdir(parents=True)
    (node / "device").symlink_to(root / "sys/devices/platform/csi")
    assert usb_of((81, 1), sys=root / "sys") is None
    assert usb_of((81, 2), sys=root / "sys") is None


SHOWN = """\
Id=dnb-edge.service
LoadState=loaded
UnitFileState=enabled
ActiveState=active
SubState=running
Result=success
NRestarts=2
WatchdogUSec=10s
StatusText=lap 4 of 10, last 12.483 s
SupplementaryGroups=video dialout
MainPID=812

Id=dnb-edge-web.service
LoadState=not-found
UnitFileState=
ActiveState=inactive
SubState=dead
Result=success
NRestarts=0
WatchdogUSec=0
StatusText=
SupplementaryGroups=
MainPID=0
"""


def test_what_systemctl_says_of_units() -> None:
    """A paragraph a unit; one that is not installed is told as such."""
    asked: list[str] = []
    units = unit_facts.ask_units(lambda words: asked.extend(words) or SHOWN)
    race, web = units["dnb-edge.service"], units["dnb-edge-web.service"]
    assert asked[:3] == ["show", "dnb-edge.service", "dnb-edge-web.service"]
    assert (race.is_installed, race.is_enabled, race.active, race.restarts) == (True, True, "active", 2)
    assert (race.has_watchdog, race.groups, race.main_pid) == (True, ("video", "dialout"), 812)
    assert race.status == "lap 4 of 10, last 12.483 s"
    assert (web.is_installed, web.is_enabled, web.has_watchdog, web.main_pid) == (False, False, False, None)


@pytest.mark.parametrize("text", ["", "nonsense", "Id=other.service\n"])
def test_a_manager_that_says_nothing_of_them(text: str) -> None:
    """Is no answer, and no fault of the units."""
    with pytest.raises(CannotTell):
        unit_facts.ask_units(lambda _: text)


def test_a_systemctl_that_fails_is_told_in_its_own_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A real program of that name, as in a container without a service manager; and none at all."""
    program = tmp_path / "systemctl"
    program.write_text("#!/bin/sh\necho 'Failed to connect to bus: Host is down' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(CannotTell, match="Host is down"):
        unit_facts.systemctl(["show"])
    program.write_text("#!/bin/sh\necho Id=$1\n")
    assert unit_facts.systemctl(["x"]) == "Id=x\n"
    program.unlink()
    with pytest.raises(CannotTell, match="no systemd"):
        unit_facts.systemctl(["show"])


@pytest.mark.parametrize(
    ("said", "armed"), [("RuntimeWatchdogUSec=15s", True), ("RuntimeWatchdogUSec=0", False), ("", None)]
)
def test_the_machines_own_watchdog(plant: Plant, said: str, armed: bool | None) -> None:
    """Whether there is one, and whether the manager feeds it."""
    unit = unit_facts.parse_units(SHOWN)["dnb-edge.service"]
    root = plant({"dev/watchdog0": ""})
    found = service_facts.find_watchdogs(unit, dev=root / "dev", ask=lambda _: said)
    assert (found.hardware, found.armed) == (True, armed)
    assert not service_facts.find_watchdogs(unit, dev=root / "none", ask=lambda _: said).hardware


def test_this_machine() -> None:
    """Everything can be found on a real Linux, and is in its bounds."""
    root = Path("/")
    assert machine_facts.find_python().version >= (3, 11, 0)
    assert machine_facts.find_system(root).machine
    assert machine_facts.is_synchronised() in (True, False)
    ticking = machine_facts.watch_ticking(root)
    assert (ticking.backwards, ticking.resolution_s < 1e-4) == (0, True)
    memory = machine_facts.find_memory(root, race_runs=False)
    assert 0 < memory.available_bytes <= memory.total_bytes
    load = machine_facts.find_load(root)
    assert load.waiting >= 0
    assert load.processors >= 1


def test_another_machine(plant: Plant) -> None:
    """The same from a tree: what a Raspberry Pi says."""
    root = plant(
        {
            "etc/os-release": 'PRETTY_NAME="Raspbian GNU/Linux 12 (bookworm)"\nID=raspbian\nVERSION_ID="12"',
            "proc/meminfo": "MemTotal:        1000 kB\nMemFree: 1 kB\nMemAvailable:     400 kB\nHugePages_Total: 0\n",
            "proc/loadavg": "1.25 0.9 0.7 2/345 6789",
            "sys/devices/system/clocksource/clocksource0/current_clocksource": "arch_sys_counter",
            "sys/devices/platform/soc/soc:firmware/get_throttled": "50000",
        }
    )
    system = machine_facts.find_system(root)
    assert (system.kind, system.version, system.name) == ("raspbian", "12", "Raspbian GNU/Linux 12 (bookworm)")
    memory = machine_facts.find_memory(root, race_runs=True)
    assert (memory.available_bytes, memory.total_bytes, memory.race_runs) == (409_600, 1_024_000, True)
    assert machine_facts.find_load(root).waiting == 1.25
    assert machine_facts.watch_ticking(root).source == "arch_sys_counter"
    slowed = machine_facts.find_slowed(root)
    assert (slowed.now, slowed.bits) == (False, 0x50000)


def test_a_machine_that_does_not_tell(plant: Plant) -> None:
    """No fact is made up."""
    root = plant({"proc/meminfo": "MemTotal: 10 kB"})
    assert machine_facts.find_system(root).name == "an unknown system"
    assert machine_facts.watch_ticking(root).source is None
    assert machine_facts.find_slowed(root).bits is None
    with pytest.raises(CannotTell):
        machine_facts.find_memory(root, race_runs=False)


def test_writing_is_measured_and_leaves_nothing(tmp_path: Path) -> None:
    """A real file on a real disk, gone afterwards."""
    found = disk_facts.measure_writing(tmp_path, chunks=4, syncs=3)
    assert found.bytes_per_s > 0
    assert found.sync_s >= 0
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileNotFoundError):
        disk_facts.measure_writing(tmp_path / "gone")


MOUNTS = """\
/dev/sda1 / ext4 rw,relatime 0 0
tmpfs /run tmpfs rw,nosuid 0 0
/dev/sdb1 {base}/a\\040♥\\040stick vfat rw 0 0
/dev/sdc1 {base}/ro ext4 ro,relatime 0 0
overlay {base}/ro/over overlay rw 0 0
"""


def test_the_deepest_mount_counts(tmp_path: Path) -> None:
    """By the table of mounts, spaces in names and all."""
    table = tmp_path / "mounts"
    table.write_text(MOUNTS.format(base=tmp_path))
    for name, kind, read_only in [
        ("runs", "ext4", False),
        ("a ♥ stick/runs", "vfat", False),
        ("ro/x", "ext4", True),
        ("ro/over", "overlay", False),
    ]:
        found = disk_facts.find_mount(tmp_path / name, mounts=table)
        assert (found.kind, found.read_only) == (kind, read_only), name
    real = disk_facts.find_mount(tmp_path, mounts=Path("/proc/self/mounts"))
    assert tmp_path.is_relative_to(real.mount_point)
    table.write_text("")
    with pytest.raises(CannotTell):
        disk_facts.find_mount(tmp_path, mounts=table)


def test_room_by_the_configuration(tmp_path: Path) -> None:
    """The rate is that of the pictures kept; a directory that is still to be made lies where its parent does."""
    record = RecordConfig(image_fps=2.0, image_ring_mb=100.0, keep_free_mb=1.0)
    space = disk_facts.find_space(tmp_path / "to" / "be", record, frame_bytes=50_000.0)
    assert (space.pictures_bytes_per_s, space.ring_left_bytes, space.keep_free_bytes) == (100_000.0, 1e8, 1_000_000)
    assert space.free_bytes > 0
    assert disk_facts.find_space(tmp_path, RecordConfig(image_ring_mb=0.0), frame_bytes=None).ring_left_bytes == float(
        "inf"
    )


MAGIC = b"\x89MCAP0\r\n"


def test_recordings_are_told_apart(tmp_path: Path) -> None:
    """Whole, cut short, damaged, and being recorded just now, which is no fault."""
    names = [f"run-0123abcd-000{number}.mcap" for number in range(1, 6)]
    (tmp_path / names[0]).write_bytes(MAGIC + b"x" * 100 + MAGIC)
    (tmp_path / names[1]).write_bytes(MAGIC + b"x" * 100)
    (tmp_path / f"{names[2]}.part").write_bytes(MAGIC)
    (tmp_path / f"{names[3]}.part").touch()
    (tmp_path / names[4]).write_bytes(b"")
    (tmp_path / "mine.mcap").write_bytes(b"no run of ours")
    (tmp_path / f"{names[3]}.part").unlink()
    live = DurableFile(tmp_path / names[3])
    try:
        found = disk_facts.find_recordings(tmp_path)
    finally:
        live.discard()
    assert (found.whole, found.live) == (1, 1)
    assert found.unfinished == ("run-0123abcd-0003",)
    assert set(found.damaged) == {"run-0123abcd-0002", "run-0123abcd-0005"}


def test_who_may_write(tmp_path: Path) -> None:
    """By owner, group and mode, as the kernel decides it."""
    place = tmp_path / "runs"
    place.mkdir(mode=0o700)
    assert service_facts.may_write(place, MINE) is True
    place.chmod(0o500)
    assert service_facts.may_write(place, MINE) is False
    assert service_facts.may_write(place, "nobody") is False
    place.chmod(0o777)
    assert service_facts.may_write(place, "nobody") is True
    assert service_facts.may_write(place, "nobody-of-that-name") is None
    place.chmod(0o700)
    found = disk_facts.find_holder(place, installed=True, may=lambda *_: False)
    assert (found.is_there, found.service_may) == (True, False)
    gone = disk_facts.find_holder(tmp_path / "gone", installed=False, may=lambda *_: True)
    assert (gone.is_there, gone.service_may, gone.may_write) == (False, None, False)


class _Pages(http.server.BaseHTTPRequestHandler):
    hosts: list[str] = []  # noqa: RUF012 one server in one test

    def do_GET(self) -> None:
        self.hosts.append(self.headers["Host"])
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def pages() -> Iterator[int]:
    """The port of a real server."""
    server = http.server.HTTPServer(("127.0.0.1", 0), _Pages)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server.server_address[1]
    server.shutdown()
    thread.join()
    server.server_close()


def test_pages_that_answer_and_pages_that_do_not(pages: int) -> None:
    """Asked under a name that the guard lets in; nobody at the port is told as the system says it."""
    found = service_facts.reach_web(pages, is_installed=True)
    assert (found.status, found.fault) == (200, None)
    assert _Pages.hosts == [f"localhost:{pages}"]
    nobody = service_facts.reach_web(1, is_installed=False)
    assert (nobody.status, nobody.fault) == (None, "Connection refused")


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: the master's descriptor, and the slave's path."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_a_display_is_told_an_empty_board_and_heard(line: tuple[int, str]) -> None:
    """What it gets is right by the protocol; what it says itself is shown without control characters."""
    master, path = line
    heard: list[bytes] = []

    def panel() -> None:
        while b"RUN" not in b"".join(heard) and select.select([master], [], [], 5.0)[0]:
            heard.append(os.read(master, 4096))
        os.write(master, b"PANEL\x07 1\r\n")

    thread = threading.Thread(target=panel)
    thread.start()
    taking = service_facts.try_display(f"serial:{path}")
    thread.join()
    assert (taking.fault, taking.answer) == (None, "PANEL  1")
    told = b"".join(heard).split(b"\r\n")
    messages = [protocol.parse_line(one + b"\r\n") for one in told[:-1] if one]
    assert isinstance(messages[0], protocol.Hello)


def test_a_display_that_is_not_there(tmp_path: Path) -> None:
    """The system's words, not pyserial's; and a display without a port cannot be asked."""
    taking = service_facts.try_display(f"serial:{tmp_path}/gone")
    assert taking.fault == "No such file or directory"
    with pytest.raises(CannotTell):
        service_facts.try_display("terminal:")


def test_a_displays_port(line: tuple[int, str], plant: Plant) -> None:
    """There, not there with those that are, not needed, no display at all, no such kind."""
    dev = plant({"dev/ttyUSB0": "", "dev/ttyACM1": "", "dev/ttyS0": ""}) / "dev"
    there = service_facts.find_port(f"serial:{line[1]}", unit_groups=(), dev=dev)
    assert there.access is not None
    gone = service_facts.find_port("serial:/dev/gone", unit_groups=(), dev=dev)
    assert (gone.access, gone.ports) == (None, (f"{dev}/ttyUSB0", f"{dev}/ttyACM1"))
    assert not service_facts.find_port("terminal:", unit_groups=(), dev=dev).needs_port
    assert service_facts.port_of("spi:/dev/spidev0.1?brightness=5") == Path("/dev/spidev0.1")
    with pytest.raises(CannotTell, match="cannot say"):
        service_facts.try_display("spi:/dev/spidev0.1")
    assert service_facts.find_port(None, unit_groups=(), dev=dev).uri is None
    assert service_facts.find_port("oled:0", unit_groups=(), dev=dev).fault is not None


def test_a_board_is_told_from_a_pc_by_its_device_tree(plant: Plant) -> None:
    """A Raspberry Pi slows down at 80 degrees, a PC does not; on Debian's kernel the Pi's firmware tells nothing."""
    zone = "sys/class/thermal/thermal_zone0"
    root = plant({f"{zone}/type": "cpu-thermal", f"{zone}/temp": "81000"})
    assert (machine_facts.find_heat(root).celsius, machine_facts.find_heat(root).is_board) == (81.0, False)
    plant({"sys/firmware/devicetree/base/model": "Raspberry Pi 4 Model B"})
    assert machine_facts.find_heat(root).is_board
