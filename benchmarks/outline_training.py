"""Train a network of `nuno.estimate.outline_net`: ``python benchmarks/outline_training.py --help``.

Needs PyTorch (``pip install torch``). It reads what `outline_pairs.py` wrote. Of every real silhouette the
candidates' evidence is the mean over the guesses of exp(t h + r), with h the hand-made log likelihood, r the
network's output for the pair (0 at first) and t a temperature; the loss is the cross-entropy of the true candidate.
Real picks near the hand are more frequent among the examples than others, which the logarithms of their frequencies
make up for. While training, pictures are mirrored, moved and resized at random, and the real one's edge is moved a
little more. What is judged and kept is the running mean of the weights, of that epoch which is best on scenes held
out: those whose number modulo 12 is 0. Of those where it is 1 the judgement is printed and chooses nothing; so in the
end are shares of h and r, as `nuno.estimate.learned` adds them.
"""

from __future__ import annotations

import argparse
import copy
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from nuno.estimate.learned import HAND_MADE_SHARE
from nuno.estimate.outline_net import LEVELS, SCALARS, SIZE, STRIDES

CHANNELS = (24, 48, 64, 64, 96)
WIDE, NARROW = 96, 48
HELD_OUT = 12  # one scene in so many chooses the epoch, and another is for checking
AT_ONCE = 64  # real silhouettes
PEAK = 3e-3  # learning rate
MEMORY = 500  # steps over which weights are averaged
MOVED, SCALED = 3.0, 0.08  # [px], share: up to so much a pair of pictures is moved and resized
EDGE, EDGE_KNOTS = 0.35, 12  # [px] standard deviation of the real edge's displacement; independent ones across
GUESSES = 5  # of eight, drawn anew for every step


class Net(nn.Module):
    """Two pictures and a few scalars to one number; `outline_net` is the same in NumPy."""

    def __init__(self, scalars: int = SCALARS) -> None:
        super().__init__()
        self.scalars = scalars
        layers: list[nn.Module] = []
        before = 2
        for k, (channels, stride) in enumerate(zip(CHANNELS, STRIDES, strict=True)):
            side = 5 if k == 0 else 3
            layers += [nn.Conv2d(before, channels, side, stride, side // 2, bias=False), nn.BatchNorm2d(channels)]
            layers.append(nn.ReLU())
            before = channels
        self.look = nn.Sequential(*layers)
        self.dense = nn.Linear(CHANNELS[-1] * (SIZE // 16) ** 2, WIDE)
        self.norm = nn.BatchNorm1d(scalars)
        self.mix, self.narrow, self.ratio = (
            nn.Linear(WIDE + scalars, WIDE),
            nn.Linear(WIDE, NARROW),
            nn.Linear(NARROW, 1),
        )
        nn.init.zeros_(self.ratio.weight)
        nn.init.zeros_(self.ratio.bias)
        self.drop = nn.Dropout(0.2)
        self.temperature = nn.Parameter(torch.ones(()))

    def forward(self, images: Any, scalars: Any) -> Any:
        """(n,) of images (n, 2, SIZE, SIZE) and scalars (n, scalars)."""
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


def moved(real: Any, imagined: Any, place: Any) -> tuple[Any, Any, Any]:
    """Mirror, move and resize pictures (n, SIZE, SIZE) and (n, k, SIZE, SIZE), and change places (n, 4) to match."""
    n, device = len(real), real.device
    mirror = torch.where(torch.rand(n, device=device) < 0.5, -1.0, 1.0)
    scale = 1.0 + SCALED * (2 * torch.rand(n, device=device) - 1)
    shift = MOVED / SIZE * (2 * torch.rand(n, 2, device=device) - 1)
    across, down = mirror * scale * place[:, 0] + shift[:, 0], scale * place[:, 1] + shift[:, 1]
    place = torch.cat([torch.stack([across, down], dim=1), place[:, 2:] / scale[:, None]], dim=1)
    steps = (torch.arange(SIZE, device=device) + 0.5) / SIZE - 0.5
    x = ((steps - shift[:, :1]) / scale[:, None] * mirror[:, None])[:, None].expand(n, SIZE, SIZE)
    y = ((steps - shift[:, 1:]) / scale[:, None])[:, :, None].expand(n, SIZE, SIZE)
    grid = 2 * torch.stack([x, y], dim=-1)
    noise = torch.randn(n, 2, EDGE_KNOTS, EDGE_KNOTS, device=device)
    noise = functional.interpolate(noise, size=(SIZE, SIZE), mode="bicubic", align_corners=True)
    rough = grid + noise.permute(0, 2, 3, 1) * (2 * EDGE / SIZE)
    real = functional.grid_sample(real[:, None], rough, align_corners=False)[:, 0]
    return real, functional.grid_sample(imagined, grid, align_corners=False), place


def ratios(net: Net, data: dict[str, Any], rows: Any) -> tuple[Any, Any]:
    """The network's numbers (n, best, guesses), and which guesses; while training of some, and of moved pictures."""
    n, best = data["candidates"][rows].shape
    device = data["imagined"].device
    every = data["imagined"].shape[2]
    some = torch.randperm(every, device=device)[:GUESSES] if net.training else torch.arange(every, device=device)
    imagined = unpacked(data["imagined"][rows][:, :, some].flatten(1, 2))
    real, place = unpacked(data["real"][rows]), data["place"][rows].float()
    if net.training:
        real, imagined, place = moved(real, imagined, place)
    images = torch.stack([real[:, None].expand_as(imagined), imagined], dim=2).flatten(0, 1)
    images = images.contiguous(memory_format=torch.channels_last)
    pair = data["pair"][rows][:, :, some].float()
    guess = data["guess"][rows][:, some].float()[:, None].expand(-1, best, -1, -1)
    scalars = torch.cat([pair, place[:, None, None].expand(-1, best, len(some), -1), guess], dim=-1).flatten(0, 2)
    with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
        return net(images, scalars[:, : net.scalars]).float().view(n, best, len(some)), some


def evidence(net: Net, data: dict[str, Any], rows: Any, shares: tuple[float, float] | None = None) -> Any:
    """(n, 36) log evidence of the candidates; while training of some guesses.

    Args:
        net: The network.
        data: The examples.
        rows: (n,) which of them.
        shares: Of the hand-made log likelihood and of the network's number; None takes the temperature and 1.
    """
    found, some = ratios(net, data, rows)
    by_hand, learned = shares or (net.temperature, 1.0)
    logs = by_hand * data["likelihood"][rows][:, :, some].float()
    at = data["candidates"][rows].long()[..., None].expand(-1, -1, len(some))
    return torch.logsumexp(logs.scatter_add(1, at, learned * found), dim=2) - math.log(len(some))


def judge(found: Any, true: Any) -> tuple[float, float, Any]:
    """Mean ln p of the true candidates (at least -12), share of exact answers, and which are (n,)."""
    exact = found.argmax(1) == true
    log = functional.log_softmax(found, dim=1).gather(1, true[:, None]).clamp(min=-12)
    return float(log.mean()), float(exact.float().mean()), exact


def judged(net: Net, data: dict[str, Any], rows: Any, shares: tuple[float, float] | None = None) -> Any:
    """`judge` of some examples (n,)."""
    net.eval()
    with torch.no_grad():
        found = torch.cat([evidence(net, data, part, shares) for part in rows.split(128)])
    return judge(found, data["true"][rows].long())


def check(net: Net, data: dict[str, Any], rows: Any) -> None:
    """Print how good the evidence is, by shares of both likelihoods."""
    base: Any = None
    for shares in ((1.0, 0.0), None, *((a, b) for a in (0.4, 0.6, 0.8, 1.0) for b in (0.35, 0.5, 0.75, 1.0))):
        log, share, exact = judged(net, data, rows, shares)
        base = exact if base is None else base
        print(
            f"shares {shares}: ln p {log:.3f}, exact {share:.1%}, "
            f"righted {int((exact & ~base).sum())}, spoilt {int((base & ~exact).sum())}", flush=True,
        )  # fmt: skip


def begun(path: Path, data: dict[str, Any], rows: Any) -> Net:
    """A network with the weights of one that was written, an .npz as Nuno brings it.

    Its batch norms were folded into its layers, so each gets the mean and deviation of some examples now, and the
    share and bias that make up for them: at first it says the same.
    """
    net = Net().to(rows.device)
    with np.load(path, allow_pickle=False) as file:
        stored = {name: torch.from_numpy(file[name]).to(rows.device) for name in file.files}

    def layer(name: str, *shape: int) -> Any:
        whole = stored[name].flatten(1).float() * stored[f"{name}.scale"][:, None]
        return whole.view(len(whole), *shape)

    side, last = SIZE // 16, CHANNELS[-1]
    with torch.no_grad():
        x = pictures_of(data, rows[torch.randperm(len(rows), device=rows.device)[:AT_ONCE]])
        for k, channels in enumerate((2, *CHANNELS[:-1])):
            convolution, norm = net.look[3 * k], net.look[3 * k + 1]
            width = convolution.kernel_size[0]
            convolution.weight.copy_(layer(f"conv{k}", width, width, channels).permute(0, 3, 1, 2))
            x = convolution(x)
            norm.running_mean.copy_(x.mean((0, 2, 3)))
            norm.running_var.copy_(x.var((0, 2, 3)))
            norm.weight.copy_(torch.sqrt(norm.running_var + norm.eps))
            norm.bias.copy_(stored[f"conv{k}.bias"] + norm.running_mean)
            x = functional.relu(x + stored[f"conv{k}.bias"][:, None, None])
        net.dense.weight.copy_(layer("dense", side, side, last).permute(0, 3, 1, 2).flatten(1))
        net.dense.bias.copy_(stored["dense.bias"])
        net.norm.running_mean.copy_(stored["mean"])
        net.norm.running_var.copy_(stored["deviation"] ** 2 - net.norm.eps)
        for name in ("mix", "narrow", "ratio"):
            part = getattr(net, name)
            part.weight.copy_(layer(name, part.in_features))
            part.bias.copy_(stored[f"{name}.bias"])
        net.temperature.fill_(HAND_MADE_SHARE)
    return net


def pictures_of(data: dict[str, Any], rows: Any) -> Any:
    """All pairs of pictures (n, 2, SIZE, SIZE) of some examples."""
    imagined = unpacked(data["imagined"][rows].flatten(1, 2))
    return torch.stack([unpacked(data["real"][rows])[:, None].expand_as(imagined), imagined], dim=2).flatten(0, 1)


def train(
    net: Net, data: dict[str, Any], rows: Any, choosing: Any, checking: Any, epochs: float, seconds: float, peak: float
) -> Net:
    """AdamW, one cycle, by epochs or by the clock; the mean weights of the epoch that is best of those who choose."""
    started, steps, at, epoch = time.perf_counter(), max(1, int(epochs * len(rows) / AT_ONCE)), len(rows), 0
    optimiser = torch.optim.AdamW(net.parameters(), lr=peak, weight_decay=0.05, betas=(0.9, 0.98))
    mean, best, kept = copy.deepcopy(net), -math.inf, copy.deepcopy(net)
    losses: list[Any] = []
    for step in range(steps + 1):
        done = max(step / steps, (time.perf_counter() - started) / seconds)
        if at + AT_ONCE > len(rows) or done >= 1.0:
            if losses:
                epoch += 1
                log, share, _ = judged(mean, data, choosing)
                other = judged(mean, data, checking)[:2] if len(checking) else (math.nan, math.nan)
                print(
                    f"epoch {epoch}, step {step}, {time.perf_counter() - started:.0f} s: loss "
                    f"{float(torch.stack(losses).mean()):.3f}; ln p {log:.3f}, exact {share:.1%}; "
                    f"checking {other[0]:.3f}, {other[1]:.1%}; t {float(mean.temperature.detach()):.2f}", flush=True,
                )  # fmt: skip
                losses.clear()
                if log > best:
                    best, kept = log, copy.deepcopy(mean)
            if done >= 1.0:
                break
            order, at = rows[torch.randperm(len(rows), device=rows.device)], 0
        part, at = order[at : at + AT_ONCE], at + AT_ONCE
        optimiser.param_groups[0]["lr"] = peak * min(1.0, (step + 1) / 100) * (0.5 + 0.5 * math.cos(math.pi * done))
        net.train()
        logits = evidence(net, data, part) + data["weight"][part].float()
        loss = functional.cross_entropy(logits, data["true"][part].long())
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        losses.append(loss.detach())
        share = max(1.0 / MEMORY, 1.0 / (step + 1))
        with torch.no_grad():
            for old, new in zip(mean.state_dict().values(), net.state_dict().values(), strict=True):
                if old.is_floating_point():
                    old.lerp_(new, share)
    return kept if math.isfinite(best) else mean


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
    parser.add_argument("--epochs", type=float, default=20.0)
    parser.add_argument("--seconds", type=float, default=1e9, help="shorter, where it is earlier")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--begin", type=Path, help="an .npz of an earlier run to begin from, at half the learning rate")
    parser.add_argument("--device", default="cuda:0")
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    started = time.perf_counter()
    data = load(options.pairs, options.device)
    part = data["scene"] % HELD_OUT
    choosing, checking, rows = (torch.nonzero(which)[:, 0] for which in (part == 0, part == 1, part > 1))
    print(
        f"{len(rows)} examples, {len(choosing)} for choosing, {len(checking)} for checking, "
        f"{time.perf_counter() - started:.0f} s", flush=True,
    )  # fmt: skip
    net = Net().to(options.device) if options.begin is None else begun(options.begin, data, rows)
    peak = PEAK if options.begin is None else PEAK / 2
    net = train(net, data, rows, choosing, checking, options.epochs, options.seconds, peak)
    for held in (choosing, checking):
        if len(held):
            check(net, data, held)
    write(net, options.out)


if __name__ == "__main__":
    main()
