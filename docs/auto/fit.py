#!/usr/bin/env python3
"""Fit the network of `--operator auto` to scenes of known radiance: fit.py DATA OUT [--minutes 60].

DATA holds panoramas/, panoramas_more/ and hdr_images/ (.hdr, .exr). Every fifth panorama by name
is left out of the fit and only judged by. Writes OUT/auto.pt at every check, OUT/auto.onnx at last.
Needs the extra `fit` (PyTorch, ONNX); the product itself runs the result with cv2.dnn.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing as mp
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from network import EDGES_STOPS, PEAKS, Network, compose, gate, load_state, pq
from scenes import read_hdr, sample, scene_paths
from torch import Tensor
from torch.nn import functional

SIZE = (480, 288)


def feed(paths: list[Path], seed: int, queue: mp.Queue, batch: int) -> None:
    """Puts batches (codes uint8 (b, h, w, 3), luminance float16 (b, h, w)) for ever."""
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


def pq_errors(z: Tensor, codes: Tensor, truth: Tensor) -> Tensor:
    """Log of the mean squared PQ error at three scales and both peaks, summed: (b,)."""
    loss = torch.zeros(len(z))
    for peak, weight in zip(PEAKS, (1.0, 0.35), strict=True):
        test = pq(203 * compose(z, codes, math.log2(peak)).clamp(max=peak))
        error = test - pq(203 * truth.clamp(max=peak))
        for scale, share in ((1, 1.0), (4, 0.6), (16, 0.4)):
            e = functional.avg_pool2d(error[:, None], scale) if scale > 1 else error
            loss = loss + weight * share * torch.log(e.square().flatten(1).mean(1) + 1e-6)
    return loss


def level_errors(z: Tensor, codes: Tensor, truth: Tensor) -> Tensor:
    """Cross-entropy of the levels where the frame clips: (b,); no gradient vanishes at 0 and 1."""
    edges = torch.tensor(EDGES_STOPS).view(1, -1, 1, 1)
    height = torch.log2(truth.clamp(min=1e-4))[:, None]
    levels = ((height - edges[:, :-1]) / (edges[:, 1:] - edges[:, :-1])).clamp(0, 1)
    weight = gate(codes.amax(-1, keepdim=True).permute(0, 3, 1, 2).float() / 255)
    pooled = functional.avg_pool2d(weight, 2)
    levels = functional.avg_pool2d(levels * weight, 2) / pooled.clamp(min=1e-4)
    entropy = functional.binary_cross_entropy_with_logits(z, levels, reduction="none").mean(
        1, keepdim=True
    )
    return (entropy * pooled).sum((1, 2, 3)) / (pooled.sum((1, 2, 3)) + 50)


def psnr_gain(net: Network, batches: list[tuple[Tensor, Tensor]]) -> Tensor:
    """PQ-PSNR (dB) over SDR as it is, for each picture, at the 1000-nit peak."""
    gains = []
    with torch.no_grad():
        for codes, truth in batches:
            want = pq(203 * truth.clamp(max=PEAKS[0]))
            z = net(codes)
            errors = [
                pq(203 * compose(levels, codes, math.log2(PEAKS[0])).clamp(max=PEAKS[0])) - want
                for levels in (z, z * 0 - 40)
            ]
            ours, sdr = (error.square().mean((1, 2)) for error in errors)
            gains.append(10 * torch.log10(sdr / ours))
    return torch.cat(gains)


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
    p.add_argument("--threads", type=int, default=1)
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--start", type=Path, help="state to go on from")
    a = p.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(a.threads)
    torch.manual_seed(a.seed)
    fit, held = scene_paths(a.data)
    rng = np.random.default_rng(1)
    held_pairs = [sample(read_hdr(path), SIZE, rng) for path in held for _ in range(4)]
    check = [
        (torch.from_numpy(np.stack([c for c, _ in held_pairs[i : i + 4]])),
         torch.from_numpy(np.stack([t for _, t in held_pairs[i : i + 4]])))
        for i in range(0, len(held_pairs), 4)
    ]  # fmt: skip
    spawn = mp.get_context("spawn")  # a fork would inherit locked thread pools
    queue = spawn.Queue(6)
    feeder = spawn.Process(target=feed, args=(fit, a.seed + 7, queue, a.batch), daemon=True)
    feeder.start()
    net = Network().to(memory_format=torch.channels_last)
    if a.start:
        load_state(net, a.start)
    mean = {k: v.clone() for k, v in net.state_dict().items()}
    optimiser = torch.optim.AdamW(net.parameters(), lr=a.rate, weight_decay=1e-2)
    weights = sum(v.numel() for v in net.parameters())
    print(f"{weights} weights, {len(fit)} scenes, {len(held)} held out", flush=True)
    start, step, running, log = time.monotonic(), 0, 0.0, []
    last = start
    while (done := (time.monotonic() - start) / 60 / a.minutes) < 1:
        rate = a.rate * min(1, (step + 1) / 100) * (0.51 + 0.49 * math.cos(math.pi * done))
        for group in optimiser.param_groups:
            group["lr"] = rate
        codes, truth = (torch.from_numpy(x) for x in queue.get())
        truth = truth.float()
        with torch.autocast("cpu", torch.bfloat16):
            z = net(codes)
        z = z.float()
        loss = pq_errors(z, codes, truth).mean() + 4 * level_errors(z, codes, truth).mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 2.0)
        optimiser.step()
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
            gain = psnr_gain(judge.eval(), check)
            torch.save(mean, a.out / "auto.pt")
            worst = gain.view(-1, 4).mean(1).min()  # of the scenes
            log.append({"step": step, "loss": running, "gain_db": gain.mean().item()})
            print(
                f"{done:.0%} {step} {running:.2f} {gain.mean():+.2f} dB, {worst:+.2f}", flush=True
            )
            (a.out / "log.json").write_text(json.dumps(log, indent=1))
    feeder.terminate()
    torch.save(mean, a.out / "auto.pt")
    net = Network()
    net.load_state_dict(mean)
    net.export(a.out / "auto.onnx")


if __name__ == "__main__":
    main()
