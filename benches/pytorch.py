#!/usr/bin/env python3
"""Time of PyTorch's training steps on the networks of benches/training.rs, forward, backward and Adam.

    python3 benches/pytorch.py && cargo bench --bench training

Needs torch, numpy and scipy (Debian: python3-torch python3-scipy). Medians, in milliseconds.
"""

import os
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import nn

LATENT, HIDDEN = 64, 256


class Encoder(nn.Module):
    """A shared MLP over points, their maximum, and an MLP; normalised so that it cannot collapse."""

    def __init__(self):
        super().__init__()
        self.points = nn.Sequential(nn.Linear(3, 64), nn.ReLU(), nn.Linear(64, 128), nn.ReLU(), nn.Linear(128, 256))
        self.head = nn.Sequential(
            nn.BatchNorm1d(256), nn.ReLU(), nn.Linear(256, 256), nn.BatchNorm1d(256), nn.ReLU(),
            nn.Linear(256, LATENT), nn.BatchNorm1d(LATENT, affine=False))

    def forward(self, points):
        return self.head(self.points(points).amax(1))


class Generator(nn.Module):
    """Two branches that move a template: fully connected, and deconvolutions of stride and kernel 2."""

    def __init__(self, template, n_fc, side):
        super().__init__()
        self.template = nn.Parameter(template)
        self.fc = nn.Sequential(
            nn.Linear(LATENT, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 512), nn.ReLU(), nn.Linear(512, 3 * n_fc, bias=False))
        doublings = (side // 4).bit_length() - 1
        channels = [max(128 >> i, 16) for i in range(doublings + 1)]
        self.coarsest = nn.Sequential(nn.Linear(LATENT, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 16 * channels[0]), nn.ReLU())
        layers = []
        for i, (before, after) in enumerate(zip(channels, channels[1:])):
            if i + 1 == doublings:
                layers += [nn.Conv2d(before, before, 3, padding=1), nn.ReLU()]
            layers += [nn.ConvTranspose2d(before, after, 2, stride=2), nn.ReLU()]
        self.grid = nn.Sequential(*layers, nn.Conv2d(channels[-1], 3, 1, bias=False))

    def forward(self, latent):
        fc = self.fc(latent).reshape(len(latent), -1, 3)
        grid = self.grid(self.coarsest(latent).reshape(len(latent), -1, 4, 4))
        return self.template + torch.cat([fc, grid.flatten(2).transpose(1, 2)], 1)


class Regressors(nn.Module):
    """Four halvings of 64 × 64 crops; heads of the style, and of 16 anchors with what refines them."""

    def __init__(self, outputs):
        super().__init__()
        layers, before = [], 4
        for i, after in enumerate([32, 48, 64, 96]):
            layers += [nn.Conv2d(before, after, 4, stride=2, padding=1), nn.BatchNorm2d(after), nn.ReLU()]
            if i > 0:
                layers += [nn.Conv2d(after, after, 3, padding=1), nn.BatchNorm2d(after), nn.ReLU()]
            before = after
        self.trunk = nn.Sequential(*layers, nn.Flatten(), nn.Linear(16 * before, 256), nn.ReLU())
        self.style = nn.Linear(256, LATENT)
        self.pose = nn.Sequential(nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, outputs))

    def forward(self, crops):
        features = self.trunk(crops)
        return self.style(features), self.pose(features)


def nearest(points, queries):
    return cKDTree(points).query(queries)[1]


def chamfer(predicted, target, pool):
    """Neighbours outside the graph by k-d trees, on as many threads as PyTorch; distances inside it."""
    x, y = predicted.detach().numpy(), target.numpy()
    forward = np.stack(list(pool.map(nearest, y, x)))
    backward = np.stack(list(pool.map(nearest, x, y)))
    pick = lambda points, index: points.gather(1, torch.from_numpy(index)[..., None].expand(-1, -1, 3))
    there = (predicted - pick(target, forward)).square().sum(2).mean(1)
    back = (target - pick(predicted, backward)).square().sum(2).mean(1)
    return (there + back).mean()


def timed(name, module, loss, repeats=10):
    optimizer = torch.optim.Adam(module.parameters(), 1e-3)
    seconds = []
    for _ in range(repeats + 2):
        start = time.perf_counter()
        optimizer.zero_grad()
        loss(module).backward()
        optimizer.step()
        seconds.append(time.perf_counter() - start)
    weights = sum(p.numel() for p in module.parameters()) / 1e6
    print(f"{name:20} {1e3 * np.median(seconds[2:]):8.1f} ms   {weights:5.2f} M weights")


def cars(batch, n):
    """Clouds on boxes of a car's proportions: surfaces as flat as a car's."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (batch, n, 3))
    axis = rng.integers(0, 3, (batch, n, 1))
    np.put_along_axis(points, axis, np.sign(np.take_along_axis(points, axis, 2)) / 2, 2)
    return torch.from_numpy((points * [0.4, 0.3, 0.85]).astype(np.float32))


def main():
    torch.manual_seed(0)
    torch.set_num_threads(os.cpu_count())
    print(f"PyTorch {torch.__version__}, {torch.get_num_threads()} threads")
    with ThreadPoolExecutor(torch.get_num_threads()) as pool:
        for n_fc, side in [(1024, 32), (8192, 128)]:
            target = cars(8, n_fc + side * side)
            module = nn.ModuleDict({"encoder": Encoder(), "generator": Generator(target[0].clone(), n_fc, side)})
            step = lambda m: chamfer(m["generator"](m["encoder"](target[:, :1024])), target, pool)
            timed(f"autoencoder_{n_fc + side * side}", module, step, 5)
    crops, style, pose = torch.rand(32, 4, 64, 64), torch.rand(32, LATENT), torch.rand(32, 3 + 16 * 7)

    def step(module):
        predicted, outputs = module(crops)
        return (predicted - style).square().mean() + (outputs - pose).square().mean()

    timed("regressors", Regressors(pose.shape[1]), step)


if __name__ == "__main__":
    main()
