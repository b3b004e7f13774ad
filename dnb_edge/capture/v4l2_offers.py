"""What pictures a V4L2 camera offers: formats, sizes and rates, and which of them serves.

Knows the kernel's enumerations through linuxpy. The choice itself is pure. Knows no control and no frame.
"""

from __future__ import annotations

import errno
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from linuxpy.video import device as linux
from linuxpy.video import raw

from dnb_edge.capture.settings import RATE_SHARE
from dnb_edge.errors import InputError

JPEG_FORMATS = ("MJPG", "JPEG")
_PREFERRED = (*JPEG_FORMATS, "YUYV")
_KIND = linux.BufferType.VIDEO_CAPTURE
_MOST_WORDS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Frame rates of one size: those `listed`, or all `between` two; both empty where the driver does not say."""

    listed: tuple[Fraction, ...] = ()
    between: tuple[Fraction, Fraction] | None = None

    def have(self, fps: float) -> bool:
        """Whether `fps` is one of them; True where nothing is known against it."""
        if self.between is not None:
            slowest, fastest = self.between
            return float(slowest) * (1.0 - RATE_SHARE) <= fps <= float(fastest) * (1.0 + RATE_SHARE)
        return not self.listed or any(abs(fps - float(rate)) <= RATE_SHARE * float(rate) for rate in self.listed)

    def words(self) -> str:
        """Such as `30, 15 fps`; empty where nothing is known."""
        if self.between is not None:
            return f"{_number(self.between[0])} to {_number(self.between[1])} fps"
        return f"{', '.join(_number(rate) for rate in self.listed)} fps" if self.listed else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """One size, or all from `least_px` to `most_px` by steps of `step_px`, (width, height) each, with the rates there."""

    least_px: tuple[int, int]
    most_px: tuple[int, int]
    step_px: tuple[int, int] = (1, 1)
    rates: Rates = Rates()

    def has(self, width_px: int, height_px: int) -> bool:
        """Whether this size is among them."""
        asked = zip((width_px, height_px), self.least_px, self.most_px, self.step_px, strict=True)
        return all(least <= side <= most and (side - least) % step == 0 for side, least, most, step in asked)

    def words(self) -> str:
        """Such as `1280x720 at 30, 15 fps`."""
        (width, height), (most_width, most_height) = self.least_px, self.most_px
        text = f"{width}x{height}"
        if self.least_px != self.most_px:
            text += f" to {most_width}x{most_height}"
        rates = self.rates.words()
        return f"{text} at {rates}" if rates else text


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """One pixel format and its sizes; none where the driver does not say which."""

    pixel_format: str
    """FourCC, such as `MJPG`."""
    sizes: tuple[Size, ...] = ()

    def has(self, width_px: int, height_px: int, fps: float) -> bool:
        """Whether the camera gives this format at that size and rate, as far as is known."""
        if not self.sizes:
            return True
        return any(size.has(width_px, height_px) and size.rates.have(fps) for size in self.sizes)

    def words(self) -> str:
        """The format with its sizes and rates, the largest sizes first."""
        sizes = sorted(self.sizes, key=lambda size: size.most_px, reverse=True)
        more = f"; {len(sizes) - _MOST_WORDS} more" if len(sizes) > _MOST_WORDS else ""
        return f"{self.pixel_format} {'; '.join(size.words() for size in sizes[:_MOST_WORDS])}{more}".strip()


def read_offers(device: linux.Device, width_px: int, height_px: int) -> list[Offer]:
    """All that the open `device` offers; of a range of sizes the rates are those at `width_px` x `height_px`, where it holds
    that, else at its largest. Raises `OSError` as the kernel does."""
    offers = []
    entry = raw.v4l2_fmtdesc()
    entry.type = _KIND
    for found in linux.iter_read(device, raw.IOC.ENUM_FMT, entry):
        fourcc = int(found.pixelformat)
        # The highest bit marks the big-endian twin of a format.
        letters = linux.human_pixel_format(fourcc & 0x7FFFFFFF)
        pixel_format = letters if letters.isascii() and letters.isprintable() else f"{fourcc:#x}"
        known = pixel_format in _PREFERRED
        sizes = _read_sizes(device, fourcc, (width_px, height_px)) if known else ()
        offers.append(Offer(pixel_format=pixel_format, sizes=sizes))
    return offers


def choose(
    path: Path, offers: Sequence[Offer], *, width_px: int, height_px: int, fps: float, asked: str | None = None
) -> str:
    """The FourCC to use: the one `asked` for, else MJPEG, else YUYV, as far as the camera has it at that size and rate.

    Raises `InputError` naming what the camera has.
    """
    if asked is not None and asked not in _PREFERRED:
        raise InputError(
            f"{path}: capture.pixel_format: {asked!r} cannot be decoded here: use one of {', '.join(_PREFERRED)}"
        )
    wanted = _PREFERRED if asked is None else (asked,)
    usable = sorted(
        (offer for offer in offers if offer.pixel_format in wanted), key=lambda offer: wanted.index(offer.pixel_format)
    )
    if not usable:
        names = list(dict.fromkeys(offer.pixel_format.strip() for offer in offers))
        more = f" and {len(names) - _MOST_WORDS} more" if len(names) > _MOST_WORDS else ""
        offered = f"{', '.join(names[:_MOST_WORDS]) or 'no format'}{more}"
        raise InputError(
            f"{path}: capture.pixel_format: the camera offers {offered}, and {' or '.join(wanted)} is needed"
        )
    for offer in usable:
        if offer.has(width_px, height_px, fps):
            return offer.pixel_format
    sized = [size for offer in usable for size in offer.sizes if size.has(width_px, height_px)]
    if sized:
        key, lacking = "capture.fps", f"{width_px}x{height_px} at {fps:g} fps"
    else:
        key, lacking = "capture.width_px, capture.height_px", f"{width_px}x{height_px}"
    has = ". ".join(offer.words() for offer in usable)
    raise InputError(f"{path}: {key}: the camera has no {lacking}; it has {has}")


def _read_sizes(device: linux.Device, fourcc: int, asked_px: tuple[int, int]) -> tuple[Size, ...]:
    sizes = []
    entry = raw.v4l2_frmsizeenum()
    entry.pixel_format = fourcc
    for found in linux.iter_read(device, raw.IOC.ENUM_FRAMESIZES, entry):
        if found.type == raw.Frmsizetypes.DISCRETE:
            side = int(found.discrete.width), int(found.discrete.height)
            sizes.append(Size(least_px=side, most_px=side, rates=_read_rates(device, fourcc, side)))
            continue
        step = found.stepwise
        one = Size(
            least_px=(int(step.min_width), int(step.min_height)),
            most_px=(int(step.max_width), int(step.max_height)),
            step_px=(max(1, int(step.step_width)), max(1, int(step.step_height))),
        )
        at = asked_px if one.has(*asked_px) else one.most_px
        rates = _read_rates(device, fourcc, at)
        sizes.append(Size(least_px=one.least_px, most_px=one.most_px, step_px=one.step_px, rates=rates))
    return tuple(sizes)


def _read_rates(device: linux.Device, fourcc: int, size_px: tuple[int, int]) -> Rates:
    listed: list[Fraction] = []
    entry = raw.v4l2_frmivalenum()
    entry.pixel_format = fourcc
    entry.width, entry.height = size_px
    for found in linux.iter_read(device, raw.IOC.ENUM_FRAMEINTERVALS, entry):
        if found.type == raw.Frmivaltypes.DISCRETE:
            listed += _rate(found.discrete)
            continue
        # The kernel speaks of intervals: the shortest is the fastest rate.
        slowest, fastest = _rate(found.stepwise.max), _rate(found.stepwise.min)
        return Rates(between=(slowest[0], fastest[0])) if slowest and fastest else Rates()
    return Rates(listed=tuple(sorted(set(listed), reverse=True)))


def _rate(interval: raw.v4l2_fract) -> list[Fraction]:
    """The rate of an interval in seconds; empty for the nonsense that some drivers tell."""
    if not interval.numerator or not interval.denominator:
        return []
    return [Fraction(int(interval.denominator), int(interval.numerator))]


def _number(rate: Fraction) -> str:
    return f"{float(rate):.4g}"


def set_rate(device: linux.Device, fps: float) -> float | None:
    """Ask for `fps` frames a second; the rate that the driver then claims, None for drivers that know no rate."""
    try:
        device.set_fps(_KIND, fps)
        return float(device.get_fps(_KIND))
    except ZeroDivisionError:
        return None
    except OSError as error:
        if error.errno in (errno.ENOTTY, errno.EINVAL):
            return None
        raise
