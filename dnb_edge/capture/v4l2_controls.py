"""A V4L2 camera's controls: what the configuration asks, in the driver's words and order, and what the camera took.

Knows the kernel's control numbers, since drivers' names for them have changed over the years. Knows no format and no frame.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from linuxpy.video import device as linux
from linuxpy.video import raw

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.errors import InputError
from dnb_edge.values import CameraControl

_EXPOSURE_UNIT_US = 100.0
"""V4L2_CID_EXPOSURE_ABSOLUTE counts in units of 100 us."""
_AUTO, _MANUAL, _SHUTTER_PRIORITY, _APERTURE_PRIORITY = range(4)
"""The menu of V4L2_CID_EXPOSURE_AUTO. Webcams know the second and the last, which is their automatic."""
_POWER_LINE: dict[object, int] = {"off": 0, 50: 1, 60: 2, "auto": 3}
_ID = linux.ControlID
_UNSEEN = linux.ControlFlag.DISABLED | linux.ControlFlag.HAS_PAYLOAD
_MENUS = (linux.ControlType.MENU, linux.ControlType.INTEGER_MENU)
_RANGES = (linux.ControlType.INTEGER, linux.ControlType.INTEGER64, linux.ControlType.BOOLEAN)
_NO_VALUE = (linux.ControlType.CTRL_CLASS, linux.ControlType.BUTTON)


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """One control of one camera, as its driver describes it."""

    name: str
    """As `v4l2-ctl --list-ctrls` spells it, such as `exposure_time_absolute`."""
    least: int
    most: int
    menu: Mapping[int, str]
    """Entries by number; empty for what is no menu."""
    described: raw.v4l2_query_ext_ctrl

    @property
    def ident(self) -> int:
        """The kernel's number of it."""
        return int(self.described.id)

    def takes(self, value: int) -> bool:
        """Whether the driver says that it accepts `value`."""
        if self.described.type in _MENUS:
            return value in self.menu
        return self.described.type not in _RANGES or self.least <= value <= self.most

    def words(self) -> str:
        """The values that it accepts."""
        if self.described.type in _MENUS:
            return ", ".join(f"{number} ({text})" for number, text in self.menu.items()) or "nothing"
        return f"{self.least} to {self.most}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """One control to be set."""

    key: str
    """The configuration's key that asks for it."""
    control: Control
    value: int


def read_controls(device: linux.Device) -> dict[int, Control]:
    """The single-valued controls of the open `device`, by the kernel's number, in the driver's order."""
    controls: dict[int, Control] = {}
    described = raw.v4l2_query_ext_ctrl()
    described.id = int(linux.ControlFlag.NEXT_CTRL)
    while True:
        try:
            linux.ioctl(device, raw.IOC.QUERY_EXT_CTRL, described)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                return controls
            raise
        if not int(described.flags) & int(_UNSEEN) and described.type != linux.ControlType.CTRL_CLASS:
            control = _described(device, described)
            controls[control.ident] = control
        described.id = int(described.id) | int(linux.ControlFlag.NEXT_CTRL)


def wishes(path: Path, controls: Mapping[int, Control], settings: CaptureSettings) -> list[Wish]:
    """What `settings` ask of a camera with `controls`, in the order in which it has to be set: what is automatic goes off
    before the value that it held. Raises `InputError` naming the key and what the camera has.
    """
    asked = [
        *_exposure(path, controls, settings.exposure_us),
        *_gain(path, controls, settings.gain),
        *_either(
            path, controls, "capture.white_balance_k", settings.white_balance_k,
            automatic=_ID.AUTO_WHITE_BALANCE, value=_ID.WHITE_BALANCE_TEMPERATURE,
        ),
        *_either(
            path, controls, "capture.focus", settings.focus, automatic=_ID.FOCUS_AUTO, value=_ID.FOCUS_ABSOLUTE
        ),
        *_power_line(path, controls, settings.power_line_hz),
        *(_by_name(path, controls, name, value) for name, value in settings.controls.items()),
    ]  # fmt: skip
    for wish in asked:
        if not wish.control.takes(wish.value):
            raise InputError(
                f"{path}: {wish.key}: the camera's {wish.control.name} cannot be {wish.value}: "
                f"it takes {wish.control.words()}"
            )
    return asked


def apply(device: linux.Device, path: Path, wanted: Iterable[Wish]) -> None:
    """Set each control in turn. Raises `InputError` where the camera refuses one, `OSError` where it has gone."""
    for wish in wanted:
        try:
            linux.set_controls_values(device, [(wish.control.described, wish.value)])
        except OSError as error:
            if error.errno == errno.ENODEV:
                raise
            raise InputError(
                f"{path}: {wish.key}: the camera refuses to set {wish.control.name} to {wish.value} "
                f"({error.strerror}): leave it out, or switch off what is automatic about it"
            ) from error


def taken(device: linux.Device, wanted: Iterable[Wish]) -> tuple[CameraControl, ...]:
    """What the camera says of each control that was asked for, now; of one asked for twice the last."""
    asked = {wish.control.name: wish for wish in wanted}
    return tuple(
        CameraControl(name=name, asked=wish.value, taken=value_of(device, wish.control)) for name, wish in asked.items()
    )


def _described(device: linux.Device, described: raw.v4l2_query_ext_ctrl) -> Control:
    kept = raw.v4l2_query_ext_ctrl.from_buffer_copy(described)
    least, most = int(kept.minimum), int(kept.maximum)
    name = bytes(kept.name).split(b"\0")[0].decode("utf-8", "replace")
    return Control(
        name="_".join("".join(c if c.isalnum() else " " for c in name.lower()).split()),
        least=least,
        most=most,
        menu=_menu(device, kept) if kept.type in _MENUS else {},
        described=kept,
    )


def _menu(device: linux.Device, described: raw.v4l2_query_ext_ctrl) -> dict[int, str]:
    entries = {}
    entry = raw.v4l2_querymenu()
    for number in range(max(0, int(described.minimum)), min(int(described.maximum), 64) + 1):
        entry.id, entry.index = int(described.id), number
        try:
            linux.ioctl(device, raw.IOC.QUERYMENU, entry)
        except OSError as error:
            if error.errno == errno.EINVAL:
                continue  # menus may have holes
            raise
        numbers = described.type == linux.ControlType.INTEGER_MENU
        entries[number] = str(entry.value) if numbers else bytes(entry.name).split(b"\0")[0].decode("utf-8", "replace")
    return entries


def value_of(device: linux.Device, control: Control) -> int | None:
    """What the camera says; None where it does not tell."""
    unread = linux.ControlFlag.WRITE_ONLY
    if control.described.type in _NO_VALUE or int(control.described.flags) & int(unread):
        return None
    try:
        return int(linux.get_controls_values(device, [control.described])[0])
    except OSError as error:
        if error.errno == errno.ENODEV:
            raise
        return None


def _need(path: Path, controls: Mapping[int, Control], key: str, *idents: linux.ControlID) -> Control:
    """The first of `idents` that the camera has."""
    for ident in idents:
        if ident in controls:
            return controls[ident]
    wanted = _NAMES[idents[0]]
    raise InputError(f"{path}: {key}: the camera has no {wanted}: it has {_list(controls)}")


def _exposure(path: Path, controls: Mapping[int, Control], asked: Literal["auto"] | float | None) -> list[Wish]:
    key = "capture.exposure_us"
    if asked is None:
        return []
    if asked == "auto":
        control = _need(path, controls, key, _ID.EXPOSURE_AUTO)
        mode = _AUTO if _AUTO in control.menu else _APERTURE_PRIORITY
        return [Wish(key=key, control=control, value=mode)]
    value = _need(path, controls, key, _ID.EXPOSURE_ABSOLUTE)
    found = []
    automatic = controls.get(_ID.EXPOSURE_AUTO)
    if automatic is not None:
        # With shutter priority the time is ours, and only the iris the camera's.
        mode = _MANUAL if _MANUAL in automatic.menu else _SHUTTER_PRIORITY
        found.append(Wish(key=key, control=automatic, value=mode))
    slower = controls.get(_ID.EXPOSURE_AUTO_PRIORITY)
    if slower is not None:
        # "Dynamic framerate": the camera would give fewer frames for the sake of light.
        found.append(Wish(key=key, control=slower, value=0))
    units = round(asked / _EXPOSURE_UNIT_US)
    if not value.takes(units):
        raise InputError(
            f"{path}: {key}: the camera cannot expose for {asked:g} us: it takes {value.least * _EXPOSURE_UNIT_US:g} to "
            f"{value.most * _EXPOSURE_UNIT_US:g} us"
        )
    return [*found, Wish(key=key, control=value, value=units)]


def _gain(path: Path, controls: Mapping[int, Control], asked: float | None) -> list[Wish]:
    key = "capture.gain"
    if asked is None:
        return []
    value = _need(path, controls, key, _ID.GAIN, _ID.ANALOGUE_GAIN)
    automatic = controls.get(_ID.AUTOGAIN)
    off = [Wish(key=key, control=automatic, value=0)] if automatic is not None else []
    return [*off, Wish(key=key, control=value, value=_whole(path, key, asked))]


def _either(
    path: Path,
    controls: Mapping[int, Control],
    key: str,
    asked: Literal["auto"] | float | None,
    *,
    automatic: linux.ControlID,
    value: linux.ControlID,
) -> list[Wish]:
    """A control that the camera itself may hold."""
    if asked is None:
        return []
    if asked == "auto":
        return [Wish(key=key, control=_need(path, controls, key, automatic), value=1)]
    control = _need(path, controls, key, value)
    switch = controls.get(automatic)
    off = [Wish(key=key, control=switch, value=0)] if switch is not None else []
    return [*off, Wish(key=key, control=control, value=_whole(path, key, asked))]


def _power_line(path: Path, controls: Mapping[int, Control], asked: str | int | None) -> list[Wish]:
    key = "capture.power_line_hz"
    if asked is None:
        return []
    return [Wish(key=key, control=_need(path, controls, key, _ID.POWER_LINE_FREQUENCY), value=_POWER_LINE[asked])]


def _by_name(path: Path, controls: Mapping[int, Control], name: str, value: int) -> Wish:
    for control in controls.values():
        if control.name == name:
            return Wish(key=f"capture.controls.{name}", control=control, value=value)
    raise InputError(f"{path}: capture.controls: the camera has no control {name!r}: it has {_list(controls)}")


def _whole(path: Path, key: str, asked: float) -> int:
    if asked != round(asked):
        raise InputError(f"{path}: {key}: V4L2 cameras take whole numbers, not {asked:g}")
    return round(asked)


def _list(controls: Mapping[int, Control]) -> str:
    return ", ".join(sorted(control.name for control in controls.values())) or "no controls"


_NAMES = {
    _ID.EXPOSURE_AUTO: "automatic exposure (auto_exposure)",
    _ID.EXPOSURE_ABSOLUTE: "exposure time (exposure_time_absolute)",
    _ID.GAIN: "gain",
    _ID.AUTO_WHITE_BALANCE: "automatic white balance (white_balance_automatic)",
    _ID.WHITE_BALANCE_TEMPERATURE: "colour temperature (white_balance_temperature)",
    _ID.FOCUS_AUTO: "automatic focus (focus_automatic_continuous)",
    _ID.FOCUS_ABSOLUTE: "focus (focus_absolute)",
    _ID.POWER_LINE_FREQUENCY: "power-line frequency (power_line_frequency)",
}
"""Controls by today's names, for a camera that lacks them."""
