"""The machine's own state, read from trees that look like Linux's."""

import os
from pathlib import Path

import pytest

from dnb_edge.machine.state import firmware_bits, read_machine


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


@pytest.mark.parametrize(("text", "bits"), [("50005", 0x50005), ("0", 0), ("?", None)])
def test_the_firmwares_own_word(tmp_path: Path, text: str, bits: int | None) -> None:
    """Its bits as they are, those of the past too; nothing where it says no number, or is not there."""
    assert firmware_bits(tree(tmp_path, {FIRMWARE: text}) / "sys") == bits
    assert firmware_bits(tmp_path / "gone") is None


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
