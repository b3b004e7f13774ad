"""Facts of picture, set-up, disk, machine, services and display to verdicts: a table for each rule."""

from dataclasses import replace
from pathlib import Path

import pytest

from dnb_edge.capture.picture_health import PictureFault
from dnb_edge.doctor import disk_rules, machine_rules, picture_rules, service_rules, setup_rules
from dnb_edge.doctor.access import Access
from dnb_edge.doctor.sight import Beat
from dnb_edge.doctor.unit_facts import UnitLook
from dnb_edge.doctor.verdict import Verdict
from dnb_edge.live.messages import Phase

RUNS = Path("/var/lib/dnb-edge/runs")


def check(verdict: Verdict, status: str, said: str = "") -> None:
    """The verdict's status and words; a fault's fix says something to type, to set or to open."""
    assert verdict.status.value == status, verdict
    assert said in f"{verdict.found} -> {verdict.fix}", verdict
    assert verdict.fix is None or any(mark in verdict.fix for mark in ("`", "capture.", "http://", "pages")), verdict


@pytest.mark.parametrize("fault", list(PictureFault))
def test_picture(fault: PictureFault) -> None:
    """Each fault of the picture has its own words and its own fix."""
    check(picture_rules.judge_shows(fault), "fail", fault.value)
    check(picture_rules.judge_shows(None), "ok")


@pytest.mark.parametrize(
    ("edge_px", "width_px", "status", "said"),
    [
        (None, 1280, "skip", "too few edges"),
        (2.2, 1280, "ok", "2.2 px wide, 7 mm"),
        (4.6, 1280, "warn", "lens"),
        (4.6, 1920, "ok", ""),
        (7.1, 1280, "fail", "lens"),
        (4.6, 640, "warn", "lens"),
    ],
)
def test_sharpness(edge_px: float | None, width_px: int, status: str, said: str) -> None:
    """In px of a picture 1280 px wide; larger pictures may be softer by their scale, smaller ones not sharper."""
    sharp = picture_rules.Sharpness(edge_px=edge_px, width_px=width_px, mm_per_px=3.0)
    check(picture_rules.judge_sharpness(sharp), status, said)


def beat(share: float | None, over: float | None = 20.0, *, mains_hz: int = 50) -> Beat:
    return Beat(mains_hz=mains_hz, beat_hz=10.0, share=share, over_others=None if share is None else over)


@pytest.mark.parametrize(
    ("beats", "status", "said"),
    [
        ([beat(None), beat(None, mains_hz=60)], "skip", "stand still"),
        ([beat(0.002), beat(None, mains_hz=60)], "ok", "60 Hz stand still"),
        ([beat(0.03), beat(0.001, mains_hz=60)], "warn", "power_line_hz: 50"),
        ([beat(0.001), beat(0.03, mains_hz=60)], "warn", "exposure_us: 8300"),
        ([beat(0.09)], "fail", "exposure_us: 10000"),
        ([beat(0.03, 3.0)], "ok", ""),
    ],
)
def test_flicker(beats: list[Beat], status: str, said: str) -> None:
    """A beat counts where it is strong, and stronger than what the picture does anyway."""
    check(picture_rules.judge_flicker(beats), status, said)


@pytest.mark.parametrize(
    ("moved_m", "sure", "status"),
    [(None, True, "ok"), (0.003, True, "ok"), (0.006, True, "fail"), (None, False, "warn")],
)
def test_place(moved_m: float | None, sure: bool, status: str) -> None:
    """Moved further than laps stand for is a failure; not to be told is worth a look."""
    check(picture_rules.judge_place(picture_rules.Place(moved_m=moved_m, is_sure=sure, limit_m=0.005)), status)


STATE = setup_rules.SetupState(config=RUNS / "a.yaml", wanted=Path("/etc/x"), setup=Path("/var/s"), draft=None)
CALIBRATION = setup_rules.CalibrationFound(fault=None, method="markers", mean_m=0.004, sigma_m=0.006, age_days=3.0)


@pytest.mark.parametrize(
    ("verdict", "status", "said"),
    [
        (setup_rules.judge_set_up(STATE), "ok", "a.yaml"),
        (setup_rules.judge_set_up(replace(STATE, config=None)), "fail", "neither /etc/x nor /var/s/dnb-edge.yaml"),
        (setup_rules.judge_set_up(replace(STATE, config=None, draft=Path("d"))), "fail", "begun on the pages"),
        (setup_rules.judge_config(None), "ok", ""),
        (setup_rules.judge_config("a.yaml, line 3: wrong"), "fail", "line 3"),
        (setup_rules.judge_track(setup_rules.TrackFound(fault=None, name="oval", length_m=7.4)), "ok", "oval, 7.40 m"),
        (setup_rules.judge_track(setup_rules.TrackFound(fault="gone", name="oval", length_m=None)), "fail", "gone"),
        (
            setup_rules.judge_calibration(CALIBRATION),
            "ok",
            "by markers, 4.0 mm off on average, one sigma at worst 6.0 mm",
        ),
        (setup_rules.judge_calibration(replace(CALIBRATION, fault="another camera")), "fail", "another camera"),
        (setup_rules.judge_calibration(replace(CALIBRATION, too_bad="over 2 px")), "fail", "over 2 px"),
        (setup_rules.judge_calibration(replace(CALIBRATION, doubt="mirrored")), "fail", "mirrored"),
        (setup_rules.judge_calibration(replace(CALIBRATION, mean_m=0.021)), "warn", "21.0 mm"),
        (setup_rules.judge_age(CALIBRATION), "ok", "3 days"),
        (setup_rules.judge_age(replace(CALIBRATION, age_days=61.0)), "warn", "calibrate check"),
        (setup_rules.judge_age(replace(CALIBRATION, age_days=-400.0)), "warn", "timedatectl"),
        (setup_rules.judge_age(replace(CALIBRATION, age_days=-0.2)), "ok", "0 days"),
        (setup_rules.judge_age(replace(CALIBRATION, age_days=None)), "skip", ""),
        (setup_rules.judge_model(setup_rules.ModelFound(fault=None, name="m", is_ours=True)), "ok", "SHA-256"),
        (setup_rules.judge_model(setup_rules.ModelFound(fault=None, name="m", is_ours=False)), "ok", "nothing says"),
        (setup_rules.judge_model(setup_rules.ModelFound(fault="damaged", name="m", is_ours=True)), "fail", "damaged"),
    ],
)
def test_set_up(verdict: Verdict, status: str, said: str) -> None:
    """Configuration, track, calibration, model."""
    check(verdict, status, said)


@pytest.mark.parametrize(
    ("window_ms", "whole_ms", "status"),
    [(10.0, 30.0, "ok"), (24.0, 30.0, "warn"), (34.0, 30.0, "fail"), (10.0, 101.0, "warn")],
)
def test_pace(window_ms: float, whole_ms: float, status: str) -> None:
    """A followed car must be found within a frame's time; one that is looked for may take some."""
    check(setup_rules.judge_pace(setup_rules.Pace(fps=30.0, window_ms=window_ms, whole_ms=whole_ms)), status)


@pytest.mark.parametrize(("share", "status"), [(0.0, "ok"), (0.009, "ok"), (0.02, "warn"), (0.3, "fail")])
def test_pace_of_a_race(share: float, status: str) -> None:
    """Of a running race it counts what it throws away."""
    check(setup_rules.judge_pace(setup_rules.RacePace(latency_ms=15.0, lost_share=share)), status, "15 ms")


SPACE = disk_rules.Space(
    directory=RUNS, free_bytes=20 * 10**9, keep_free_bytes=200_000_000, ring_left_bytes=2e9, pictures_bytes_per_s=150e3,
    deletes_oldest=False,
)  # fmt: skip


def test_minutes_left() -> None:
    """While the ring of pictures grows both take room, then the recording alone."""
    small = replace(SPACE, free_bytes=200_000_000 + 165_000 * 600)
    assert disk_rules.minutes_left(small) == pytest.approx(10.0)
    filling_s = 2e9 / 150e3
    large = replace(SPACE, free_bytes=int(200_000_000 + 2e9 + 15_000 * (filling_s + 6000)))
    assert disk_rules.minutes_left(large) == pytest.approx((filling_s + 6000) / 60)
    assert disk_rules.minutes_left(replace(SPACE, free_bytes=100)) == 0.0
    assert disk_rules.minutes_left(replace(small, pictures_bytes_per_s=0.0)) == pytest.approx(110.0)
    assert disk_rules.minutes_left(replace(small, ring_left_bytes=float("inf"))) == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("space", "status", "said"),
    [
        (SPACE, "ok", "20.0 GB free"),
        (replace(SPACE, free_bytes=10**9), "warn", "runs prune"),
        (replace(SPACE, free_bytes=300_000_000), "fail", "10 minutes"),
        (replace(SPACE, free_bytes=300_000_000, deletes_oldest=True), "warn", "oldest recordings will be deleted"),
        (replace(SPACE, free_bytes=450_000_000, keep_free_bytes=0, ring_left_bytes=0.0), "warn", "8 hours"),
    ],
)
def test_space(space: disk_rules.Space, status: str, said: str) -> None:
    """Room for a day; where old recordings may go, too little is no failure."""
    check(disk_rules.judge_space(space), status, said)


MOUNT = disk_rules.Mount(directory=RUNS, kind="ext4", device="/dev/sda1", mount_point="/", read_only=False)
HOLDER = disk_rules.Holder(directory=RUNS, is_there=True, may_write=True, service_may=True)
FOUND = disk_rules.Recordings(directory=RUNS, whole=3, live=0, unfinished=(), damaged=())


@pytest.mark.parametrize(
    ("verdict", "status", "said"),
    [
        (disk_rules.judge_writing(disk_rules.Writing(bytes_per_s=40e6, sync_s=0.01)), "ok", "40.0 MB/s"),
        (disk_rules.judge_writing(disk_rules.Writing(bytes_per_s=3e6, sync_s=0.01)), "warn", "A2"),
        (disk_rules.judge_writing(disk_rules.Writing(bytes_per_s=40e6, sync_s=0.3)), "warn", "300.0 ms"),
        (disk_rules.judge_writing(disk_rules.Writing(bytes_per_s=40e6, sync_s=1.6)), "fail", ""),
        (disk_rules.judge_mount(MOUNT), "ok", "ext4"),
        (disk_rules.judge_mount(replace(MOUNT, read_only=True)), "fail", "remount,rw /"),
        (disk_rules.judge_mount(replace(MOUNT, kind="tmpfs")), "fail", "gone after a restart"),
        (disk_rules.judge_mount(replace(MOUNT, kind="vfat")), "warn", "power cut"),
        (disk_rules.judge_mount(replace(MOUNT, kind="nfs4")), "warn", "another machine"),
        (disk_rules.judge_mount(replace(MOUNT, kind="odd")), "skip", ""),
        (disk_rules.judge_holder(HOLDER), "ok", ""),
        (disk_rules.judge_holder(replace(HOLDER, service_may=False)), "fail", "install -d -o dnb-edge"),
        (disk_rules.judge_holder(replace(HOLDER, is_there=False, service_may=False)), "fail", "is not there"),
        (disk_rules.judge_holder(replace(HOLDER, is_there=False, service_may=None)), "warn", "mkdir -p"),
        (disk_rules.judge_holder(replace(HOLDER, may_write=False)), "ok", ""),
        (disk_rules.judge_holder(replace(HOLDER, may_write=False, service_may=None)), "fail", "chown"),
        (disk_rules.judge_recordings(FOUND), "ok", "3 whole"),
        (disk_rules.judge_recordings(replace(FOUND, live=1)), "ok", "1 being recorded"),
        (disk_rules.judge_recordings(replace(FOUND, unfinished=("run-a",))), "warn", "1 cut short (run-a)"),
        (disk_rules.judge_recordings(replace(FOUND, damaged=("a", "b", "c", "d"))), "warn", "4 damaged (a, b, c ...)"),
    ],
)
def test_disk(verdict: Verdict, status: str, said: str) -> None:
    """Speed, kind, rights, what lies there."""
    check(verdict, status, said)


PYTHON = machine_rules.PythonFound(version=(3, 11, 7), bits=64, onnxruntime="1.27.0")
SYSTEM = machine_rules.SystemFound(name="Debian 12", kind="debian", version="12", machine="aarch64", kernel="6.1")
TICKING = machine_rules.Ticking(source="tsc", resolution_s=1e-9, backwards=0)
MEMORY = machine_rules.Memory(available_bytes=700_000_000, total_bytes=10**9, race_runs=False)


@pytest.mark.parametrize(
    ("verdict", "status", "said"),
    [
        (machine_rules.judge_python(PYTHON), "ok", "Python 3.11.7"),
        (machine_rules.judge_python(replace(PYTHON, version=(3, 10, 1))), "fail", "install.sh"),
        (machine_rules.judge_python(replace(PYTHON, bits=32)), "fail", "64-bit"),
        (machine_rules.judge_python(replace(PYTHON, onnxruntime="1.28.1")), "warn", "<1.28"),
        (machine_rules.judge_python(replace(PYTHON, onnxruntime="1.9.0")), "warn", "<1.28"),
        (machine_rules.judge_system(SYSTEM), "ok", "aarch64"),
        (machine_rules.judge_system(replace(SYSTEM, kind="raspbian", version="13")), "ok", ""),
        (machine_rules.judge_system(replace(SYSTEM, version="11")), "warn", "not tested"),
        (machine_rules.judge_system(replace(SYSTEM, machine="armv7l")), "warn", "64 bit"),
        (machine_rules.judge_synchronised(synchronised=True), "ok", ""),
        (machine_rules.judge_synchronised(synchronised=False), "warn", "timedatectl"),
        (machine_rules.judge_ticking(TICKING), "ok", "tsc"),
        (machine_rules.judge_ticking(replace(TICKING, backwards=1)), "fail", "went back"),
        (machine_rules.judge_ticking(replace(TICKING, resolution_s=0.004)), "fail", ""),
        (machine_rules.judge_ticking(replace(TICKING, source="jiffies")), "warn", "clocksource="),
        (machine_rules.judge_temperature(machine_rules.Heat(celsius=None, is_board=True)), "skip", ""),
        (machine_rules.judge_temperature(machine_rules.Heat(celsius=69.9, is_board=True)), "ok", "70 C"),
        (machine_rules.judge_temperature(machine_rules.Heat(celsius=70.0, is_board=True)), "warn", "fan"),
        (machine_rules.judge_temperature(machine_rules.Heat(celsius=80.0, is_board=True)), "fail", "fan"),
        (machine_rules.judge_temperature(machine_rules.Heat(celsius=89.0, is_board=False)), "ok", "89 C"),
        (machine_rules.judge_temperature(machine_rules.Heat(celsius=95.0, is_board=False)), "warn", "fan"),
        (machine_rules.judge_memory(MEMORY), "ok", "700 of 1000 MB"),
        (machine_rules.judge_memory(replace(MEMORY, available_bytes=500_000_000)), "warn", "ps aux"),
        (machine_rules.judge_memory(replace(MEMORY, available_bytes=500_000_000, race_runs=True)), "ok", ""),
        (machine_rules.judge_memory(replace(MEMORY, available_bytes=200_000_000)), "fail", ""),
        (machine_rules.judge_load(machine_rules.Load(waiting=1.9, processors=2)), "ok", ""),
        (machine_rules.judge_load(machine_rules.Load(waiting=2.1, processors=2)), "warn", "top"),
    ],
)
def test_machine(verdict: Verdict, status: str, said: str) -> None:
    """Interpreter, system, clocks, heat, memory, load."""
    check(verdict, status, said)


@pytest.mark.parametrize(
    ("now", "bits", "throttling", "power"),
    [
        (None, None, "skip", "skip"),
        (False, None, "ok", "skip"),
        (True, None, "fail", "skip"),
        (False, 0, "ok", "ok"),
        (True, 0x50005, "fail", "fail"),
        (False, 0x50000, "warn", "warn"),
        (False, 0x20000, "warn", "ok"),
        (False, 0x10000, "ok", "warn"),
    ],
)
def test_throttling_and_power(now: bool | None, bits: int | None, throttling: str, power: str) -> None:
    """What is now fails, what was warns; a weak supply is told apart from heat."""
    slowed = machine_rules.Slowed(now=now, bits=bits)
    check(machine_rules.judge_throttling(slowed), throttling)
    check(machine_rules.judge_power(slowed), power)


UNIT = UnitLook(
    name="dnb-edge.service", is_installed=True, is_enabled=True, active="active", result="success", restarts=0,
    has_watchdog=True, status="lap 4 of 10", groups=("video",), main_pid=7,
)  # fmt: skip
DOGS = service_rules.Watchdogs(unit=UNIT, hardware=True, armed=True)
ANSWER = service_rules.Answer(is_installed=True, phase=Phase.RACING)
REACHED = service_rules.Reached(url="http://127.0.0.1:8080/", status=200, fault=None, is_installed=True)
ACCESS = Access(path=Path("/dev/ttyUSB0"), group="dialout", group_may=True, may_open=True, service_groups=None)
PORT = service_rules.Port(uri="serial:/dev/ttyUSB0", needs_port=True, access=ACCESS)
TAKING = service_rules.Taking(uri="serial:/dev/ttyUSB0", by_service=False, fault=None)


@pytest.mark.parametrize(
    ("verdict", "status", "said"),
    [
        (service_rules.judge_unit(UNIT), "ok", "lap 4 of 10"),
        (service_rules.judge_unit(replace(UNIT, is_installed=False)), "warn", "install.sh"),
        (service_rules.judge_unit(replace(UNIT, active="failed", result="watchdog")), "fail", "failed (watchdog)"),
        (service_rules.judge_unit(replace(UNIT, active="inactive")), "fail", "systemctl start dnb-edge"),
        (service_rules.judge_unit(replace(UNIT, is_enabled=False)), "warn", "systemctl enable dnb-edge"),
        (service_rules.judge_unit(replace(UNIT, restarts=4)), "warn", "again 4 times"),
        (service_rules.judge_watchdog(DOGS), "ok", "service and machine"),
        (service_rules.judge_watchdog(replace(DOGS, unit=replace(UNIT, is_installed=False))), "skip", ""),
        (service_rules.judge_watchdog(replace(DOGS, unit=replace(UNIT, has_watchdog=False))), "fail", "WatchdogSec"),
        (service_rules.judge_watchdog(replace(DOGS, armed=False)), "warn", "--watchdog"),
        (service_rules.judge_watchdog(replace(DOGS, armed=False, hardware=False)), "ok", "the service is watched"),
        (service_rules.judge_service(ANSWER), "ok", "racing"),
        (service_rules.judge_service(replace(ANSWER, phase=None)), "fail", "systemctl restart dnb-edge"),
        (service_rules.judge_service(replace(ANSWER, phase=None, is_installed=False)), "skip", ""),
        (service_rules.judge_service(replace(ANSWER, phase=Phase.FAULT, reason="no camera")), "fail", "no camera"),
        (service_rules.judge_warnings(ANSWER), "ok", "warns of nothing"),
        (service_rules.judge_warnings(replace(ANSWER, notes=("car 2 stands",))), "ok", "car 2 stands"),
        (service_rules.judge_warnings(replace(ANSWER, warnings=("hot", "slow"))), "warn", "hot; slow"),
        (service_rules.judge_warnings(replace(ANSWER, phase=None)), "skip", ""),
        (service_rules.judge_web(REACHED), "ok", "answers"),
        (service_rules.judge_web(replace(REACHED, status=None, fault="refused")), "fail", "restart dnb-edge-web"),
        (service_rules.judge_web(replace(REACHED, status=None, is_installed=False)), "skip", ""),
        (service_rules.judge_web(replace(REACHED, status=500)), "fail", "journalctl"),
        (service_rules.judge_web(replace(REACHED, status=404)), "warn", "ss -ltnp"),
        (service_rules.judge_port(PORT), "ok", "dialout"),
        (service_rules.judge_port(service_rules.Port(uri=None)), "skip", "no display"),
        (service_rules.judge_port(service_rules.Port(uri="oled:", fault="use serial:")), "fail", "use serial:"),
        (service_rules.judge_port(service_rules.Port(uri="terminal:")), "ok", "needs no port"),
        (service_rules.judge_port(replace(PORT, access=None)), "fail", "no port for one"),
        (service_rules.judge_port(replace(PORT, uri="spi:/dev/spidev0.0", access=None)), "fail", "do_spi 0"),
        (service_rules.judge_port(replace(PORT, access=None, ports=("/dev/ttyACM0",))), "fail", "has /dev/ttyACM0"),
        (
            service_rules.judge_port(replace(PORT, access=replace(ACCESS, may_open=False))),
            "fail",
            "usermod -aG dialout",
        ),
        (service_rules.judge_taking(TAKING), "ok", "what it is told"),
        (service_rules.judge_taking(replace(TAKING, by_service=True)), "ok", "the service tells it"),
        (service_rules.judge_taking(replace(TAKING, answer="PANEL 1")), "ok", "'PANEL 1'"),
        (service_rules.judge_taking(replace(TAKING, fault="takes no bytes")), "fail", "takes no bytes"),
    ],
)
def test_services_and_display(verdict: Verdict, status: str, said: str) -> None:
    """Units, watchdogs, the live socket, the pages, the display."""
    check(verdict, status, said)
