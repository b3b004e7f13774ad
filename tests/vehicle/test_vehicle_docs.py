"""The page that says what cars may say: its lines are taken, its figures are the code's."""

import json
import re
from pathlib import Path

from dnb_edge.live.vehicle_word import MOST_CARS, MOST_INFERENCE_MS, VehicleWord
from dnb_edge.vehicle import client, client_micropython
from dnb_edge.vehicle.gateway import PAUSE_S
from dnb_edge.vehicle.ledger import BURST_S, MOST_HZ, SENDER_HZ
from dnb_edge.vehicle.signals import Word
from dnb_edge.vehicle.telemetry import MOST_LINE_BYTES, Hello, parse
from dnb_edge.vehicle.udp import MOST_PEERS, SILENT_S

PAGE = (Path(__file__).parents[2] / "docs" / "vehicle.md").read_text(encoding="utf-8")


def test_the_lines_of_the_page_are_lines() -> None:
    """What a car says there is telemetry, what the box says there are its words."""
    said, told = re.findall(r"```json\n(.*?)```", PAGE, flags=re.DOTALL)
    assert isinstance(parse(said.strip().encode(), 0), VehicleWord)
    signals = [json.loads(line)["signal"] for line in told.splitlines()]
    assert sorted(signals) == sorted([*Word, "lap"])
    (hello,) = re.findall(r"`(\{\"hello.*?\})`", PAGE)
    assert parse(hello.encode(), 0) == Hello(car=1)


def test_the_figures_of_the_page_are_the_codes() -> None:
    """Limits, times and ports."""
    assert f"at most {MOST_LINE_BYTES} bytes" in PAGE
    assert f"1 to {MOST_CARS};" in PAGE
    assert f"0 to {MOST_INFERENCE_MS:.0f}" in PAGE
    assert f"{SENDER_HZ:.0f} lines a second of one sender" in PAGE
    assert f"{MOST_HZ:.0f} of all; twice as many for a fifth of a second" in PAGE
    assert BURST_S == 1 / 5
    assert f"for {PAUSE_S * 1e3:.0f} ms at a time" in PAGE
    assert f"The {MOST_PEERS} addresses" in PAGE
    assert f"for {SILENT_S:.0f} s after the latest" in PAGE
    assert f"--udp {client.PORT} " in PAGE
    assert (client.PORT, client.SILENT_S, client.HELLO_S) == (
        client_micropython.PORT,
        client_micropython.SILENT_MS / 1e3,
        client_micropython.HELLO_MS / 1e3,
    )
    assert client.HELLO_S < SILENT_S
