"""The driving network: a front picture and the wheels' speed in, steering and throttle out; four convolutions, two layers.

Knows its layers and the sizes of its tensors only. No normalisation by the picture's own brightness: it learns that from
pictures in all light.
"""

from __future__ import annotations

import itertools

import torch
from torch import Tensor, nn

WIDTH_PX = 80
HEIGHT_PX = 60
_WIDTHS = (3, 16, 24, 32, 48)
_HIDDEN = 64


class DriverNet(nn.Module):
    """Takes `pixels` (n, 60, 80, 3) uint8 red, green, blue and `speed` (n, 1) float32 in m/s; gives (n, 2) float32: steering
    and throttle as `dnb_edge.sim.control.Control` has them, not clipped."""

    def __init__(self) -> None:
        super().__init__()
        blocks: list[nn.Module] = []
        for inputs, outputs in itertools.pairwise(_WIDTHS):
            blocks += [nn.Conv2d(inputs, outputs, 3, 2, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()]
        self.look = nn.Sequential(*blocks)
        self.first = nn.Linear(_WIDTHS[-1] * -(-WIDTH_PX // 16) * -(-HEIGHT_PX // 16) + 1, _HIDDEN)
        self.last = nn.Linear(_HIDDEN, 2)

    def forward(self, pixels: Tensor, speed: Tensor) -> Tensor:
        """The controls."""
        looked = self.look(pixels.permute(0, 3, 1, 2).to(torch.float32) * (1.0 / 255.0)).flatten(1)
        return self.last(torch.relu(self.first(torch.cat((looked, speed), dim=1))))


def parameter_count(network: nn.Module) -> int:
    """How many numbers are learnt."""
    return sum(one.numel() for one in network.parameters())
