"""The machine's own state, read from trees that look like Linux's, and what of it is worth a warning."""

import os
from pathlib import Path

import pytest
from played import wait_until

from dnb_edge.daemon.machine import MachineJudge, MachineState, MachineWatch, read_machine


def tree(root: Path, files: dict[str, str]) -> Path:
    """Files with their texts below `root`."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="ascii")
    return root


@pytest.mark.parametrize(
    ("files", "celsius"),
    [
        ({}, None),
        ({"thermal_zone0/type": "cpu-thermal", "thermal_zone0/temp": "61322"}, 61.322),
        (
            {
                "thermal_zone0/type": "acpitz",
                "thermal_zone0/temp": "90000",
                "thermal_zone1/type": "x86_pkg_temp",
                "thermal_zone1/temp": "55000",
            },
            55.0,
        ),
        ({"thermal_zone0/type": "other", "thermal_zone0/temp": "-5000"}, -5.0),
        ({"thermal_zone0/type": "cpu-thermal", "thermal_zone0/temp": "nonsense"}, None),
    ],
    ids=["none", "a Raspberry Pi", "a PC", "no processor's", "nonsense"],
)
def test_temperature(tmp_path: Path, files: dict[str, str], celsius: float | None) -> None:
    """The processor's zone wins over others; what is no number is not known."""
    root = tree(tmp_path, {f"sys/class/thermal/{name}": text for name, text in files.items()})
    assert read_machine(root=root).temperature_c == celsius


FIRMWARE = "sys/devices/platform/soc/soc:firmware/get_throttled"
FAN = "sys/class/thermal/cooling_device0"
COOLING = "sys/class/thermal/cooling_device1"
VOLT = "sys/class/hwmon/hwmon2"


@pytest.mark.parametrize(
    ("files", "throttled"),
    [
        ({}, None),
        ({FIRMWARE: "0"}, False),
        ({FIRMWARE: "50000"}, False),
        ({FIRMWARE: "50005"}, True),
        ({FIRMWARE: "?"}, None),
        ({f"{COOLING}/type": "cpufreq-cpu0", f"{COOLING}/cur_state": "0"}, False),
        ({f"{COOLING}/type": "cpufreq-cpu0", f"{COOLING}/cur_state": "3", FIRMWARE: "0"}, True),
        ({f"{FAN}/type": "pwm-fan", f"{FAN}/cur_state": "4"}, None),
        ({f"{VOLT}/name": "rpi_volt", f"{VOLT}/in0_lcrit_alarm": "1"}, True),
        ({f"{VOLT}/name": "nvme", f"{VOLT}/in0_lcrit_alarm": "1"}, None),
    ],
    ids=["none", "well", "once", "now", "nonsense", "full speed", "kernel", "a fan", "weak supply", "another's alarm"],
)
def test_throttling(tmp_path: Path, files: dict[str, str], throttled: bool | None) -> None:
    """By what is now, not by what once was; by firmware, kernel or supply."""
    assert read_machine(root=tree(tmp_path, files)).throttled is throttled


def test_memory_and_disk_of_this_machine(tmp_path: Path) -> None:
    """Resident memory is that of this process; free room is what an unprivileged process may use."""
    state = read_machine(tmp_path)
    assert state.memory_bytes is not None
    assert 10e6 < state.memory_bytes < 10e9
    assert state.disk_free_bytes is not None
    assert state.disk_free_bytes == pytest.approx(
        os.statvfs(tmp_path).f_bavail * os.statvfs(tmp_path).f_frsize, rel=0.2
    )
    assert read_machine(None).disk_free_bytes is None
    assert read_machine(tmp_path / "gone").disk_free_bytes is None


def test_warnings_come_once_and_stay_until_it_is_well_again() -> None:
    """Just under a limit, what was over it is not well yet: no warning flickers."""
    judge = MachineJudge()
    said = [judge.warnings(MachineState(temperature_c=celsius)) for celsius in (79.9, 80.0, 79.0, 77.0, 76.9, 79.0)]
    hot = [bool(warnings) for warnings in said]
    assert hot == [False, True, True, True, False, False]
    assert said[1] == ("processor at 80 C: cool the box",)
    low = [bool(judge.warnings(MachineState(disk_free_bytes=mb * 10**6))) for mb in (501, 499, 520, 551, 520)]
    assert low == [False, True, True, False, False]
    (slow,) = judge.warnings(MachineState(throttled=True))
    assert "heat or a weak supply" in slow
    assert judge.warnings(MachineState(throttled=False)) == ()


def test_the_watch_reads_by_itself(tmp_path: Path) -> None:
    """The race looks at what was read last, wherever the recording is by then."""
    with MachineWatch(lambda: tmp_path) as watch:
        wait_until(lambda: watch.state.disk_free_bytes is not None)
        assert watch.state.memory_bytes is not None
