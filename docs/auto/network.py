"""The network of `--operator auto`, in PyTorch: fitted here; the product has its own form.

From a frame's sRGB codes it predicts, for each place and each of R, G and B, how likely the clipped
radiance is to exceed each of ten levels; summed up to a peak, that is the expected log2 of the
radiance, limited to that peak. So one network serves every L'max. It works at half of the analysis
picture's size: 2 x 2 pixels are its channels.
"""

from __future__ import annotations

import math
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

PEAKS = (1000 / 203, 20.0)
EDGES_STOPS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.0, 2.5, 3.1, 3.7, 4.4)
CHANNELS = (24, 32, 48, 64, 96)  # as in itmo_video/kernels/network.c
GATE_CENTRE, GATE_SLOPE = 0.9, 40.0  # of the features, on codes
OPEN_CENTRE, OPEN_SLOPE, OPEN_FROM = 0.787, 20.2, 0.5  # of the result, on linear light
# BT.2100's ICtCp from linear BT.709 (BT.2087), and the weights of BT.2124's colour difference.
LMS_OF_709 = (
    (0.29576, 0.62308, 0.08117), (0.15619, 0.72725, 0.11656), (0.03510, 0.15658, 0.80832),
)  # fmt: skip
ITP_OF_LMS = (
    (0.5, 0.5, 0.0),
    (0.5 * 1.613769, -0.5 * 3.323486, 0.5 * 1.709717),
    (4.378174, -4.245605, -0.132568),
)  # fmt: skip


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
    """Codes uint8 (b, h, w, 3), h and w multiples of 32 -> levels' logits (b, 3k, h/2, w/2)."""

    def __init__(self) -> None:
        super().__init__()
        ch = CHANNELS
        self.down = nn.ModuleList(block(i, o) for i, o in zip((17, *ch[:-1]), ch, strict=True))
        self.whole = nn.Sequential(
            nn.Conv2d(ch[-1], ch[-1], 1), nn.LeakyReLU(0.1), nn.Conv2d(ch[-1], ch[-1], 1)
        )
        self.up = nn.ModuleList(block(i + o, o) for i, o in zip(ch[:0:-1], ch[-2::-1], strict=True))
        self.out = nn.Conv2d(ch[0], 3 * (len(EDGES_STOPS) - 1), 1)
        self.opening = nn.Parameter(torch.tensor([OPEN_CENTRE, math.log(OPEN_SLOPE)]))
        with torch.no_grad():
            self.out.weight.mul_(0.1)
            self.out.bias.copy_(torch.linspace(0.5, -2.5, len(EDGES_STOPS) - 1).repeat(3))

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


def opened(linear: Tensor, opening: Tensor) -> Tensor:
    """How far a channel counts as clipped, in [0, 1]: 0 up to OPEN_FROM, 1 at white."""
    low, white, share = (
        torch.sigmoid(opening[1].exp() * (x - opening[0]))
        for x in (torch.tensor(OPEN_FROM), torch.tensor(1.0), linear)
    )
    return ((share - low) / (white - low)).clamp(min=0)


def stops(z: Tensor, peak_stops: float) -> Tensor:
    """Expected log2 radiance above white of R, G and B, limited to a peak: (b, 3, h/2, w/2)."""
    edges = torch.tensor(EDGES_STOPS)
    widths = (edges[1:].clamp(max=peak_stops) - edges[:-1]).clamp(min=0)
    b, _, h, w = z.shape
    return (torch.sigmoid(z).view(b, 3, -1, h, w) * widths.view(1, 1, -1, 1, 1)).sum(2)


def linear_of(codes: Tensor) -> Tensor:
    """Linear RGB (b, 3, h, w) of sRGB codes uint8 (b, h, w, 3)."""
    code = codes.permute(0, 3, 1, 2).float() / 255
    return torch.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def compose(z: Tensor, codes: Tensor, peak_stops: float, opening: Tensor) -> Tensor:
    """The expanded RGB (b, 3, h, w), 1.0 at SDR white."""
    linear = linear_of(codes)
    amount = functional.interpolate(stops(z, peak_stops), scale_factor=2, mode="bilinear")
    return linear * torch.exp2(amount * opened(linear, opening))


def luminance(rgb: Tensor) -> Tensor:
    """BT.709's luminance (b, h, w) of linear RGB (b, 3, h, w)."""
    return torch.einsum("bchw,c->bhw", rgb, torch.tensor([0.2126, 0.7152, 0.0722]))


def itp(nits: Tensor) -> Tensor:
    """ICtCp of linear BT.709 in nits (b, 3, h, w), Ct halved: BT.2124's uniform space."""
    lms = torch.einsum("bchw,dc->bdhw", nits, torch.tensor(LMS_OF_709))
    return torch.einsum("bchw,dc->bdhw", pq(lms), torch.tensor(ITP_OF_LMS))


def load_state(net: Network, path: Path) -> None:
    """Load the weights that fit.py wrote."""
    net.load_state_dict(torch.load(path))
