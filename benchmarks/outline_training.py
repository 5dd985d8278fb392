"""Train the network of `nuno.estimate.outline_net`: ``python benchmarks/outline_training.py --help``.

Needs PyTorch (``pip install torch``). It reads what `outline_pairs.py` wrote. Of every real silhouette the
candidates' evidence is the mean over the guesses of exp(t h + r), with h the hand-made log likelihood, r the
network's output for the pair (0 at first) and t a temperature; the loss is the cross-entropy of the true candidate.
Real picks near the hand are more frequent among the examples than others, which the logarithms of their frequencies
make up for. One scene in twelve is held out; on these the shares of h and r that `nuno.estimate.learned` adds are
chosen.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from nuno.estimate.outline_net import LEVELS, SCALARS, SIZE, STRIDES

CHANNELS = (24, 48, 64, 64, 96)
WIDE, NARROW = 96, 48
HELD_OUT = 12
AT_ONCE = 64  # real silhouettes
GUESSES = 5  # of eight, drawn anew for every step


class Net(nn.Module):
    """Two pictures and a few scalars to one number; `outline_net` is the same in NumPy."""

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        before = 2
        for k, (channels, stride) in enumerate(zip(CHANNELS, STRIDES, strict=True)):
            side = 5 if k == 0 else 3
            layers += [nn.Conv2d(before, channels, side, stride, side // 2, bias=False), nn.BatchNorm2d(channels)]
            layers.append(nn.ReLU())
            before = channels
        self.look = nn.Sequential(*layers)
        self.dense = nn.Linear(CHANNELS[-1] * (SIZE // 16) ** 2, WIDE)
        self.norm = nn.BatchNorm1d(SCALARS)
        self.mix, self.narrow, self.ratio = (
            nn.Linear(WIDE + SCALARS, WIDE),
            nn.Linear(WIDE, NARROW),
            nn.Linear(NARROW, 1),
        )
        nn.init.zeros_(self.ratio.weight)
        nn.init.zeros_(self.ratio.bias)
        self.drop = nn.Dropout(0.1)
        self.temperature = nn.Parameter(torch.ones(()))

    def forward(self, images: Any, scalars: Any) -> Any:
        """(n,) of images (n, 2, SIZE, SIZE) and scalars (n, SCALARS)."""
        x = functional.relu(self.dense(self.look(images).flatten(1))).float()
        x = functional.relu(self.mix(torch.cat([x, self.norm(scalars)], dim=1)))
        return self.ratio(functional.relu(self.narrow(self.drop(x))))[:, 0]


def load(paths: list[Path], device: str) -> dict[str, Any]:
    """All examples, on the device."""
    parts = [np.load(path) for path in paths]
    return {k: torch.cat([torch.from_numpy(part[k]).to(device) for part in parts]) for k in parts[0].files}


def unpacked(pictures: Any) -> Any:
    """Pictures (..., SIZE, SIZE) from two pixels a byte."""
    levels = torch.stack([pictures >> 4, pictures & 15], dim=-1)
    return levels.view(*pictures.shape[:-1], SIZE, SIZE).float() / LEVELS


def evidence(net: Net, data: dict[str, Any], rows: Any, shares: tuple[float, float] | None = None) -> Any:
    """(n, 36) log evidence of the candidates; while training of some guesses, and mirrored at random.

    Args:
        net: The network.
        data: The examples.
        rows: (n,) which of them.
        shares: Of the hand-made log likelihood and of the network's number; None takes the temperature and 1.
    """
    n, best = data["candidates"][rows].shape
    device = data["imagined"].device
    every = data["imagined"].shape[2]
    some = torch.randperm(every, device=device)[:GUESSES] if net.training else torch.arange(every, device=device)
    mirrored = torch.rand(n, device=device) < (0.5 if net.training else 0.0)
    imagined = unpacked(data["imagined"][rows][:, :, some].flatten(0, 2))
    real = unpacked(data["real"][rows])[:, None, None].expand(-1, best, len(some), -1, -1).flatten(0, 2)
    images = torch.stack([real, imagined], dim=1)
    flip = mirrored.repeat_interleave(best * len(some))
    images = torch.where(flip[:, None, None, None], images.flip(3), images).to(memory_format=torch.channels_last)
    place = data["place"][rows].float()
    place = torch.cat([place[:, :1] * torch.where(mirrored, -1.0, 1.0)[:, None], place[:, 1:]], dim=1)
    pair = data["pair"][rows][:, :, some].float()
    scalars = torch.cat([pair, place[:, None, None].expand(-1, best, len(some), -1)], dim=-1).flatten(0, 2)
    with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
        ratios = net(images, scalars).float().view(n, best, len(some))
    by_hand, learned = shares or (net.temperature, 1.0)
    logs = by_hand * data["likelihood"][rows][:, :, some].float()
    at = data["candidates"][rows].long()[..., None].expand(-1, -1, len(some))
    return torch.logsumexp(logs.scatter_add(1, at, learned * ratios), dim=2) - math.log(len(some))


def judge(found: Any, true: Any) -> tuple[float, float, Any]:
    """Mean ln p of the true candidates (at least -12), share of exact answers, and which are (n,)."""
    exact = found.argmax(1) == true
    log = functional.log_softmax(found, dim=1).gather(1, true[:, None]).clamp(min=-12)
    return float(log.mean()), float(exact.float().mean()), exact


def check(net: Net, data: dict[str, Any], rows: Any) -> None:
    """Print how good the evidence is, by shares of both likelihoods."""
    net.eval()
    true = data["true"][rows].long()
    base: Any = None
    with torch.no_grad():
        for shares in ((1.0, 0.0), None, *((a, b) for a in (0.65, 0.85, 1.0) for b in (0.2, 0.35, 0.5, 0.75, 1.0))):
            parts = [evidence(net, data, part, shares) for part in rows.split(128)]
            log, share, exact = judge(torch.cat(parts), true)
            base = exact if base is None else base
            print(
                f"shares {shares}: ln p {log:.3f}, exact {share:.1%}, "
                f"righted {int((exact & ~base).sum())}, spoilt {int((base & ~exact).sum())}", flush=True,
            )  # fmt: skip
    net.train()


def train(net: Net, data: dict[str, Any], rows: Any, epochs: float) -> None:
    """AdamW, one cycle."""
    peak, steps, at = 3e-3, max(1, int(epochs * len(rows) / AT_ONCE)), len(rows)
    optimiser = torch.optim.AdamW(net.parameters(), lr=peak, weight_decay=0.02, betas=(0.9, 0.98))
    net.train()
    for step in range(steps):
        if at + AT_ONCE > len(rows):
            order, at = rows[torch.randperm(len(rows), device=rows.device)], 0
        part, at = order[at : at + AT_ONCE], at + AT_ONCE
        optimiser.param_groups[0]["lr"] = peak * min(1.0, step / 100) * (0.5 + 0.5 * math.cos(math.pi * step / steps))
        logits = evidence(net, data, part) + data["weight"][part].float()
        loss = functional.cross_entropy(logits, data["true"][part].long())
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        if step % 500 == 0:
            print(f"step {step} of {steps}, loss {float(loss.detach()):.3f}", flush=True)


def write(net: Net, path: Path) -> None:
    """The weights as `outline_net.weights` reads them, batch norms folded in."""
    net = net.eval().cpu().float()
    stored: dict[str, np.ndarray] = {}

    def keep(name: str, weight: Any, bias: Any) -> None:
        rows = weight.detach().numpy().reshape(len(weight), -1)
        scale = np.maximum(np.abs(rows).max(axis=1), 1e-12) / 127
        stored[name] = np.round(rows / scale[:, None]).astype(np.int8).reshape(weight.shape)
        stored[f"{name}.scale"], stored[f"{name}.bias"] = scale.astype(np.float32), bias.detach().numpy()

    for k in range(len(CHANNELS)):
        layer, norm = net.look[3 * k], net.look[3 * k + 1]
        scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
        weight = (layer.weight * scale[:, None, None, None]).permute(0, 2, 3, 1)
        keep(f"conv{k}", weight, norm.bias - norm.running_mean * scale)
    side = SIZE // 16
    dense = net.dense.weight.view(WIDE, CHANNELS[-1], side, side).permute(0, 2, 3, 1).reshape(WIDE, -1)
    keep("dense", dense, net.dense.bias)
    stored["mean"] = net.norm.running_mean.numpy()
    stored["deviation"] = torch.sqrt(net.norm.running_var + net.norm.eps).numpy()
    scalars = net.mix.weight[:, WIDE:]
    folded = torch.cat([net.mix.weight[:, :WIDE], scalars * net.norm.weight], dim=1)
    keep("mix", folded, net.mix.bias + scalars @ net.norm.bias)
    keep("narrow", net.narrow.weight, net.narrow.bias)
    keep("ratio", net.ratio.weight, net.ratio.bias)
    np.savez_compressed(path, **stored)


def main() -> None:
    """Train, judge on the scenes held out, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", nargs="+", type=Path, help=".npz files of outline_pairs.py")
    parser.add_argument("--out", type=Path, default=Path("outline_net.npz"))
    parser.add_argument(
        "--epochs", type=float, default=15.0, help="the network that Nuno has took 53, which is too many"
    )
    parser.add_argument("--device", default="cuda:0")
    options = parser.parse_args()
    torch.manual_seed(0)
    started = time.perf_counter()
    data = load(options.pairs, options.device)
    held = data["scene"] % HELD_OUT == 0
    rows, others = (torch.nonzero(which)[:, 0] for which in (~held, held))
    print(f"{len(rows)} examples, {len(others)} held out, {time.perf_counter() - started:.0f} s", flush=True)
    net = Net().to(options.device)
    train(net, data, rows, options.epochs)
    if len(others):
        check(net, data, others)
    write(net, options.out)


if __name__ == "__main__":
    main()
