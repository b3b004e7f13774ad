"""OLED panels of 128 x 64 on I2C: SSD1306 (0.96 inch) and SH1106 (1.3 inch).

Knows the chips' commands (Solomon Systech, SSD1306 data sheet, section 9; Sino Wealth, SH1106 data sheet). Knows no picture.
Pages are written one by one, which both chips understand. Only what changed is sent, one page more each time, and the settings
with every thirty-second picture, so that a chip that lost its memory is right again within seconds.
"""

SH1106_FIRST_COLUMN = 2
"""Its memory is 132 columns wide, and the glass shows the ones in the middle."""

SET_UP_EVERY = 32
"""Pictures."""

_DATA = 0x40
_COMMANDS = 0x00


class Oled:
    """A panel at `address` of `i2c`, which has `writeto(address, bytes)` and raises `OSError` where no chip answers."""

    def __init__(
        self,
        i2c,
        address: int = 0x3C,
        brightness: int = 3,
        *,
        first_column: int = 0,
        upside_down: bool = False,
    ) -> None:
        self._i2c = i2c
        self._address = address
        self._first_column = first_column
        self._upside_down = upside_down
        self._pages = [b""] * 8
        self._line = bytearray(1 + 128)
        self._line[0] = _DATA
        self._shown = 0
        self.brightness = brightness

    def begin(self) -> None:
        """Set the chip up and on, and know no more what it shows. Raises `OSError` where there is none."""
        self._pages = [b""] * 8
        self._shown = 0
        self._set_up()

    def show(self, surface) -> None:
        """Light each pixel of `surface` (a Canvas, 128 x 64) that is not 0. Raises `OSError` where there is no chip."""
        if self._shown % SET_UP_EVERY == 0:
            self._set_up()
        for page in range(8):
            pixels = bytes(surface.buffer[page * 1024 : page * 1024 + 1024])
            if pixels != self._pages[page] or page == self._shown % 8:
                self._send(page, pixels)
                self._pages[page] = pixels
        self._shown += 1

    def _set_up(self) -> None:
        contrast = min(max(self.brightness, 0), 15) * 17
        seen_from = (0xA0, 0xC0) if self._upside_down else (0xA1, 0xC8)
        # No scrolling, clock 0x80, 64 rows, no shift, first row 0, charge pump on, page by page, columns and rows as the board
        # has them, rows in turns, contrast, precharge, level, memory shown, not inverted, on.
        self._told(
            0x2E, 0xD5, 0x80, 0xA8, 63, 0xD3, 0, 0x40, 0x8D, 0x14, 0x20, 2, *seen_from,
            0xDA, 0x12, 0x81, contrast, 0xD9, 0xF1, 0xDB, 0x40, 0xA4, 0xA6, 0xAF,
        )  # fmt: skip

    def _send(self, page: int, pixels: bytes) -> None:
        """Eight rows, of which each byte holds one column, the topmost pixel in its lowest bit."""
        column = self._first_column
        self._told(0xB0 | page, column & 0x0F, 0x10 | (column >> 4))
        line = self._line
        for x in range(128):
            bits = 0
            for at in range(x + 896, x - 1, -128):
                bits <<= 1
                if pixels[at]:
                    bits |= 1
            line[1 + x] = bits
        self._i2c.writeto(self._address, line)

    def _told(self, *commands: int) -> None:
        self._i2c.writeto(self._address, bytes((_COMMANDS,) + commands))
