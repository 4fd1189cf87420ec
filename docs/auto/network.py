"""The network of `--operator auto`, in PyTorch: fitted here, run by cv2.dnn in the product.

From a frame's sRGB codes it tells for every place how likely the clipped radiance lies above each
of a row of levels; summed up to a peak that is the expected log2 of the radiance, held at that
peak. So one network serves every L'max. It works at half of the analysis picture's size: 2 x 2
pixels are its channels.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

PEAKS = (1000 / 203, 20.0)
EDGES_STOPS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.0, 2.5, 3.1, 3.7, 4.4)
CHANNELS = (24, 32, 48, 64, 96)
GATE_CENTRE, GATE_SLOPE = 0.9, 40.0


def pq(nits: Tensor) -> Tensor:
    """SMPTE ST 2084 code in [0, 1] of luminance in nits."""
    y = (nits.clamp(min=1e-4) / 10000) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y)) ** 78.84375


def block(i: int, o: int) -> nn.Sequential:
    """Two convolutions of 3 x 3, from i to o channels."""
    return nn.Sequential(
        nn.Conv2d(i, o, 3, padding=1),
        nn.LeakyReLU(0.1),
        nn.Conv2d(o, o, 3, padding=1),
        nn.LeakyReLU(0.1),
    )


class Network(nn.Module):
    """Codes uint8 (b, h, w, 3), h and w multiples of 32 -> levels' logits (b, k, h/2, w/2)."""

    def __init__(self) -> None:
        super().__init__()
        ch = CHANNELS
        self.down = nn.ModuleList(block(i, o) for i, o in zip((17, *ch[:-1]), ch, strict=True))
        self.whole = nn.Sequential(
            nn.Conv2d(ch[-1], ch[-1], 1), nn.LeakyReLU(0.1), nn.Conv2d(ch[-1], ch[-1], 1)
        )
        self.up = nn.ModuleList(block(i + o, o) for i, o in zip(ch[:0:-1], ch[-2::-1], strict=True))
        self.out = nn.Conv2d(ch[0], len(EDGES_STOPS) - 1, 1)
        with torch.no_grad():
            self.out.weight.mul_(0.1)
            self.out.bias.copy_(torch.linspace(0.5, -2.5, len(EDGES_STOPS) - 1))

    def forward(self, codes: Tensor) -> Tensor:
        """The levels' logits of codes."""
        return self.body(features(codes))

    def body(self, x: Tensor) -> Tensor:
        """From features (b, 17, h/2, w/2): what is exported."""
        kept = []
        for i, down in enumerate(self.down):
            x = down(functional.avg_pool2d(x, 2) if i else x)
            kept.append(x)
        # By Sub: OpenCV 5 takes an Add after a convolution for a residual of the same shape.
        x = x - self.whole(x.mean((2, 3), keepdim=True)).neg()
        for up, skip in zip(self.up, kept[-2::-1], strict=True):
            x = up(torch.cat([functional.interpolate(x, scale_factor=2.0), skip], 1))
        return self.out(x)

    def export(self, path: Path) -> None:
        """Writes the network as ONNX, for features of any size."""

        class Body(nn.Module):
            def __init__(self, net: Network) -> None:
                super().__init__()
                self.net = net

            def forward(self, x: Tensor) -> Tensor:
                return torch.sigmoid(self.net.body(x))

        axes = {2: "height", 3: "width"}
        torch.onnx.export(
            Body(self).eval(), (torch.rand(1, 17, 144, 240),), str(path), input_names=["features"],
            output_names=["levels"], dynamic_axes={"features": axes, "levels": axes}, dynamo=False,
        )  # fmt: skip


def features(codes: Tensor) -> Tensor:
    """(b, 17, h/2, w/2): the codes and gates of 2 x 2 pixels, and the height in the frame."""
    x = codes.permute(0, 3, 1, 2).float() / 255
    gates = gate(x.amax(1, keepdim=True))
    b, _, h, w = x.shape
    height = torch.linspace(-1, 1, h // 2).view(1, 1, -1, 1).expand(b, 1, h // 2, w // 2)
    x = torch.cat(
        [functional.pixel_unshuffle(x - 0.5, 2), functional.pixel_unshuffle(gates, 2), height], 1
    )
    return x.contiguous(memory_format=torch.channels_last)


def gate(maximum: Tensor) -> Tensor:
    """How far a pixel counts as clipped, in [0, 1], by its greatest code in [0, 1]; 1 at white."""
    white = torch.sigmoid(torch.tensor(GATE_SLOPE * (1 - GATE_CENTRE)))
    return torch.sigmoid(GATE_SLOPE * (maximum - GATE_CENTRE)) / white


def stops(z: Tensor, peak_stops: float) -> Tensor:
    """Expected log2 radiance above white, held at a peak: (b, h/2, w/2)."""
    edges = torch.tensor(EDGES_STOPS)
    widths = (edges[1:].clamp(max=peak_stops) - edges[:-1]).clamp(min=0)
    return (torch.sigmoid(z) * widths.view(1, -1, 1, 1)).sum(1)


def compose(z: Tensor, codes: Tensor, peak_stops: float) -> Tensor:
    """The expanded luminance (b, h, w), 1.0 at SDR white."""
    code = codes.float() / 255
    linear = torch.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    luminance = linear @ torch.tensor([0.2126, 0.7152, 0.0722])
    amount = functional.interpolate(stops(z, peak_stops)[:, None], scale_factor=2, mode="bilinear")[
        :, 0
    ]
    return luminance * torch.exp2(amount * gate(code.amax(-1)))


def load_state(net: Network, path: Path) -> None:
    """Take over the weights that fit.py wrote."""
    net.load_state_dict(torch.load(path))
