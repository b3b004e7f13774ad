"""The network: a small U-Net of plain convolutions and ReLU with five heads at a quarter of the input's resolution.

Knows its layers only. Input (n, 6, h, w) float32 in 0..1: blue, green, red, the largest absolute difference from the
background over the three, and the lean (u, v) as `dnb_edge.detect.lean` codes it; h and w multiples of 16. Outputs, each
(n, c, h / 4, w / 4):

- `heat` (1): logit that a car's ground point lies in the cell;
- `offset` (2): from the cell's centre to the ground point, (u, v), in cells;
- `size` (1): log of the car's length over 32 input px;
- `heading` (4): cos 2a, sin 2a, cos a, sin a of the heading a, v up: the axis is plain to see where nose and tail are alike;
- `spread` (1): log of one standard deviation of the ground point, in cells.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

OUTPUT_CHANNELS = {"heat": 1, "offset": 2, "size": 1, "heading": 4, "spread": 1}
INPUT_CHANNELS = 6
STRIDE = 4


def _block(inputs: int, outputs: int, *, stride: int = 1, kernel: int = 3) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class CentreNet(nn.Module):
    """About 0.36 million parameters; the widths are chosen for speed on one small core."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(_block(INPUT_CHANNELS, 16, stride=2), _block(16, 32, stride=2), _block(32, 32))
        self.down8 = nn.Sequential(_block(32, 64, stride=2), _block(64, 64))
        self.down16 = nn.Sequential(_block(64, 96, stride=2), _block(96, 96), _block(96, 96), _block(96, 64, kernel=1))
        self.up8 = _block(64, 64)
        self.narrow8 = _block(64, 32, kernel=1)
        self.up4 = _block(32, 32)
        self.neck = _block(32, 32)
        self.heads = nn.ModuleDict({name: nn.Conv2d(32, channels, 1) for name, channels in OUTPUT_CHANNELS.items()})
        heat = self.heads["heat"]
        if isinstance(heat, nn.Conv2d) and heat.bias is not None:
            nn.init.constant_(heat.bias, -4.0)

    def forward(self, image: Tensor) -> tuple[Tensor, ...]:
        """The five outputs in the order of OUTPUT_CHANNELS."""
        at4 = self.stem(image)
        at8 = self.down8(at4)
        at16 = self.down16(at8)
        at8 = self.up8(at8 + nn.functional.interpolate(at16, scale_factor=2.0, mode="nearest"))
        at4 = self.up4(at4 + nn.functional.interpolate(self.narrow8(at8), scale_factor=2.0, mode="nearest"))
        features = self.neck(at4)
        return tuple(head(features) for head in self.heads.values())


def parameter_count(network: nn.Module) -> int:
    """Number of trained values."""
    return sum(parameter.numel() for parameter in network.parameters())


def to_input(pictures: Tensor) -> Tensor:
    """(n, h, w, 6) uint8 to the network's (n, 6, h, w) float32 in 0..1."""
    return pictures.permute(0, 3, 1, 2).to(torch.float32).div_(255.0)


def scale_sigma(network: CentreNet, factor: float) -> None:
    """Make every stated sigma `factor` times as large, in place."""
    head = network.heads["spread"]
    if isinstance(head, nn.Conv2d) and head.bias is not None:
        with torch.no_grad():
            head.bias += math.log(factor)
