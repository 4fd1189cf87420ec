#!/usr/bin/env python3
"""Fit the network of `--operator auto` to scenes of known radiance: fit.py DATA OUT [--minutes 60].

DATA holds panoramas/, panoramas_more/ and hdr_images/ (.hdr, .exr). Every fifth panorama by name
is left out of the fit and used for checks only. Writes OUT/auto.pt at every check, OUT/auto.onnx at
the end.
Needs the extra `fit` (PyTorch, ONNX); operators/auto_network.py runs the result.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing as mp
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from network import (
    EDGES_STOPS,
    OPEN_FROM,
    PEAKS,
    Network,
    compose,
    gate,
    itp,
    linear_of,
    load_state,
    luminance,
    opened,
    pq,
    stops,
)
from scenes import read_hdr, sample, scene_paths
from torch import Tensor
from torch.nn import functional

SIZE = (480, 288)


def feed(paths: list[Path], seed: int, queue: mp.Queue[Any], batch: int) -> None:
    """Puts batches (codes uint8, linear RGB float16), each (b, h, w, 3), endlessly."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng(seed)
    scenes = [read_hdr(p) for p in paths]
    weights = np.array([1.0 if s.shape[1] == 2 * s.shape[0] else 0.4 for s in scenes])
    weights /= weights.sum()
    while True:
        pairs = [
            sample(scenes[rng.choice(len(scenes), p=weights)], SIZE, rng) for _ in range(batch)
        ]
        codes, truth = (np.stack(side) for side in zip(*pairs, strict=True))
        queue.put((codes, np.minimum(truth, 64).astype(np.float16)))


def scaled_errors(error: Tensor) -> Tensor:
    """Log of the mean squared errors (b, 4, h, w), of grey and of colour, at four scales: (b,)."""
    loss = torch.zeros(len(error))
    for scale, share in ((1, 1.0), (4, 0.6), (16, 0.4), (64, 0.3)):
        error = functional.avg_pool2d(error, 4) if scale > 1 else error
        squares = error.square().flatten(2).mean(2)
        grey, colour = squares[:, 0], squares[:, 1:].sum(1)
        loss = loss + share * (0.7 * torch.log(grey + 1e-6) + torch.log(colour + 1e-6))
    return loss


def picture_errors(z: Tensor, codes: Tensor, truth: Tensor, opening: Tensor, peak: float) -> Tensor:
    """Errors of PQ luminance and of colour (BT.2124) at a peak: (b,).

    Only of pixels that can be expanded: the network does not affect the others.
    """
    b, h, w, _ = codes.shape
    linear = linear_of(codes)
    bright = (linear.amax(1) > OPEN_FROM).flatten().nonzero()[:, 0]

    def picked(rgb: Tensor) -> Tensor:  # (1, 3, n, 1) of (b, 3, h, w)
        return rgb.transpose(0, 1).flatten(1)[:, bright][None, ..., None]

    linear, truth = picked(linear), picked(truth)
    amount = functional.interpolate(stops(z, math.log2(peak)), scale_factor=2, mode="bilinear")
    test = 203 * (linear * torch.exp2(picked(amount) * opened(linear, opening))).clamp(max=peak)
    want = 203 * truth.clamp(max=peak)
    grey = (pq(luminance(test)) - pq(luminance(want)))[:, None]
    error = torch.cat([grey, itp(test) - itp(want)], 1)
    full = error.new_zeros(4, b * h * w)
    full[:, bright] = error[0, ..., 0]
    return scaled_errors(full.view(4, b, h, w).transpose(0, 1))


def level_errors(z: Tensor, codes: Tensor, truth: Tensor) -> Tensor:
    """Cross-entropy of the levels where a channel clips: (b,); its gradient never vanishes."""
    edges = torch.tensor(EDGES_STOPS)
    weight = gate(codes.permute(0, 3, 1, 2).float() / 255)
    height = torch.log2(truth.clamp(min=1e-4))
    pooled = functional.avg_pool2d(weight, 2)
    b, _, h, w = pooled.shape
    at = (pooled > 0.05).nonzero(as_tuple=True)
    # The four pixels of each place, (n, 4), and the share of each level that they reach, weighed.
    squares = [functional.pixel_unshuffle(x, 2).view(b, 3, 4, h, w) for x in (weight, height)]
    weights, heights = (x[at[0], at[1], :, at[2], at[3]] for x in squares)
    levels = ((heights[..., None] - edges[:-1]) / (edges[1:] - edges[:-1])).clamp(0, 1)
    levels = (levels * weights[..., None]).sum(1) / weights.sum(1, keepdim=True)
    ours = z.view(b, 3, -1, h, w)[at[0], at[1], :, at[2], at[3]]
    entropy = functional.binary_cross_entropy_with_logits(ours, levels, reduction="none").mean(1)
    total = torch.zeros(b).index_add(0, at[0], entropy * pooled[at])
    return total / (pooled.sum((1, 2, 3)) + 100)


def gains_db(net: Network, batches: list[tuple[Tensor, Tensor]]) -> Tensor:
    """Gain in PSNR (dB) over SDR at a 1000-nit peak, of PQ luminance and of ITP: (n, 2)."""
    gains = []
    with torch.no_grad():
        for codes, truth in batches:
            want = 203 * truth.clamp(max=PEAKS[0])
            tests = (compose(net(codes), codes, math.log2(PEAKS[0]), net.opening), linear_of(codes))
            errors = [
                torch.stack(
                    [
                        (pq(luminance(test)) - pq(luminance(want))).square().mean((1, 2)),
                        (itp(test) - itp(want)).square().sum(1).mean((1, 2)),
                    ],
                    1,
                )
                for test in (203 * rgb.clamp(max=PEAKS[0]) for rgb in tests)
            ]
            gains.append(10 * torch.log10(errors[1] / errors[0]))
    return torch.cat(gains)


class Muon(torch.optim.Optimizer):
    """Momentum with orthogonalised matrices: the same loss in half of AdamW's steps here.

    After Jordan et al. 2024 (Muon), with the step's size of Liu et al. 2025: 0.2 sqrt(larger side).
    """

    def __init__(self, params: Iterable[Tensor], lr: float) -> None:
        super().__init__(params, {"lr": lr})

    @torch.no_grad()
    def step(self) -> None:
        """One step of every weight (o, i, 3, 3), taken as a matrix (o, 9i)."""
        for group in self.param_groups:
            for p in group["params"]:
                momentum = self.state[p].setdefault("momentum", torch.zeros_like(p))
                momentum.lerp_(p.grad, 0.05)
                x = p.grad.lerp(momentum, 0.95).flatten(1)
                x = x.T if x.shape[0] > x.shape[1] else x
                x = x / (x.norm() + 1e-7)
                for _ in range(5):  # Newton and Schulz's
                    square = x @ x.T
                    x = 3.4445 * x + (2.0315 * square @ square - 4.7750 * square) @ x
                x = x if p.shape[0] == x.shape[0] else x.T
                p.mul_(1 - 0.01 * group["lr"])
                p.sub_(x.reshape(p.shape), alpha=0.2 * group["lr"] * max(x.shape) ** 0.5)


def shrunk(codes: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """The pictures at 2/3 of their size: what the network sees of those wider than 480 pixels."""
    size = (SIZE[1] * 2 // 3, SIZE[0] * 2 // 3)
    small = functional.interpolate(codes.permute(0, 3, 1, 2).float(), size=size, mode="area")
    truth = functional.interpolate(truth, size=size, mode="area")
    return small.round().to(torch.uint8).permute(0, 2, 3, 1), truth


def main() -> None:
    """Fit until the time is up."""
    p = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("data", type=Path)
    p.add_argument("out", type=Path)
    p.add_argument("--minutes", type=float, default=60)
    p.add_argument("--batch", type=int, default=8)
    p.add_argument("--rate", type=float, default=2e-3)
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--start", type=Path, help="weights to start from")
    p.add_argument("--keep", type=float, default=0, help="their share in the result, 0 to 1")
    a = p.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(a.threads)
    torch.manual_seed(a.seed)
    # Ten times slower than float32 where it is emulated.
    has_bfloat16 = torch.backends.cpu.get_cpu_capability() == "AVX512"
    fit, held = scene_paths(a.data)
    rng = np.random.default_rng(1)
    held_pairs = [sample(read_hdr(path), SIZE, rng) for path in held for _ in range(4)]
    check = [
        (torch.from_numpy(np.stack([c for c, _ in held_pairs[i : i + 4]])),
         torch.from_numpy(np.stack([t for _, t in held_pairs[i : i + 4]])).permute(0, 3, 1, 2))
        for i in range(0, len(held_pairs), 4)
    ]  # fmt: skip
    spawn = mp.get_context("spawn")  # a fork would inherit locked thread pools
    queue = spawn.Queue(6)
    feeder = spawn.Process(target=feed, args=(fit, a.seed + 7, queue, a.batch), daemon=True)
    feeder.start()
    net = Network().to(memory_format=torch.channels_last)
    if a.start:
        load_state(net, a.start)
        net.opening.requires_grad_(False)  # the product has what it was fitted with
    mean = {k: v.clone() for k, v in net.state_dict().items()}
    begun = {k: v.clone() for k, v in mean.items()}
    matrices = [p for p in net.parameters() if p.ndim == 4 and p is not net.out.weight]
    others = [net.out.weight, *(p for p in net.parameters() if p.ndim < 4 and p.requires_grad)]
    optimisers = (Muon(matrices, 2 * a.rate), torch.optim.AdamW(others, lr=a.rate))
    initial = [optimiser.param_groups[0]["lr"] for optimiser in optimisers]
    weights = sum(v.numel() for v in net.parameters())
    print(f"{weights} weights, {len(fit)} scenes, {len(held)} held out", flush=True)
    start, step, running, log = time.monotonic(), 0, 0.0, []
    last = start
    while (done := (time.monotonic() - start) / 60 / a.minutes) < 1:
        share = min(1, (step + 1) / 100) * (0.505 + 0.495 * math.cos(math.pi * done))
        for optimiser, rate in zip(optimisers, initial, strict=True):
            optimiser.param_groups[0]["lr"] = rate * share
        codes, truth = (torch.from_numpy(x) for x in queue.get())
        truth = truth.float().permute(0, 3, 1, 2)
        if rng.random() < 0.25:
            codes, truth = shrunk(codes, truth)
        with torch.autocast("cpu", torch.bfloat16, enabled=has_bfloat16):
            z = net(codes)
        z = z.float()
        peak = PEAKS[0] if rng.random() < 0.74 else PEAKS[1]
        loss = picture_errors(z, codes, truth, net.opening, peak).mean()
        if step % 2:  # every second step costs less and works as well
            loss = loss + 8 * level_errors(z, codes, truth).mean()
        net.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 2.0)
        for optimiser in optimisers:
            optimiser.step()
        with torch.no_grad():  # sharper ones fail on footage with a shoulder and grain
            net.opening.clamp_(
                net.opening.new_tensor([0.7, 2.5]), net.opening.new_tensor([0.9, 3.6])
            )
        step += 1
        keep = min(0.998, step / (step + 20))
        with torch.no_grad():
            for k, v in net.state_dict().items():
                mean[k].lerp_(v, 1 - keep)
        running += (loss.item() - running) * max(0.01, 1 / step)
        if step % 20 == 0 and time.monotonic() - last > (60 if step < 400 else 240):
            last = time.monotonic()
            judge = Network()
            judge.load_state_dict(mean)
            gain = gains_db(judge.eval(), check)
            torch.save(mean, a.out / "auto.pt")
            worst = gain.view(-1, 4, 2).mean(1).amin(0)  # of the scenes
            grey, colour = gain.mean(0)
            log.append(
                {"step": step, "loss": running, "pq_db": grey.item(), "itp_db": colour.item()}
            )
            centre, slope = judge.opening.tolist()
            print(
                f"{done:.0%} {step} {running:.2f} PQ {grey:+.2f} dB, worst {worst[0]:+.2f};"
                f" ITP {colour:+.2f}, {worst[1]:+.2f}; opening {centre:.3f} {math.exp(slope):.1f}",
                flush=True,
            )
            (a.out / "log.json").write_text(json.dumps(log, indent=1))
    feeder.terminate()
    if a.start:
        mean = {k: v.lerp(begun[k], a.keep) for k, v in mean.items()}
    torch.save(mean, a.out / "auto.pt")
    net = Network()
    net.load_state_dict(mean)
    net.export(a.out / "auto.onnx")


if __name__ == "__main__":
    main()
