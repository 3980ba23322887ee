"""Train a network."""

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.extras import requires

with requires("learn", "Training a network"):
    import torch
    from torch import Tensor, nn


@dataclass(frozen=True)
class Samples:
    """Inputs and targets of the network, float32."""

    x: Tensor
    """Inputs, (N, ...)"""
    y: Tensor
    """Wanted outputs, (N, 27), zero where unknown"""
    known: Tensor
    """1 where y is known, 0 elsewhere, (N, 27)"""


def squared_error(net: nn.Module, data: Samples) -> Tensor:
    """Mean squared error over what is known."""
    return ((net(data.x) - data.y).square() * data.known).sum() / data.known.sum().clamp(min=1)


def distance(net: nn.Module, data: Samples, rounding: float = 0.05) -> Tensor:
    """Mean Euclidean distance of markers over what is known, in the common scale of their coordinates.

    This is the scored error, and large errors weigh less than squared ones. `rounding` smooths the
    tip of the cone, so that the gradient is defined at 0.
    """
    error = ((net(data.x) - data.y) * data.known).unflatten(1, (-1, 3))
    rounded = (error.square().sum(dim=2) + rounding**2).sqrt() - rounding
    return rounded.sum() / (data.known.sum() / 3).clamp(min=1)


Loss = Callable[[nn.Module, Samples], Tensor]


@dataclass(frozen=True)
class Plateau:
    """The published schedule: Adam, its rate × 0.1 after three rises in a row, until it is tiny."""

    epochs: int
    """Most passes, also if the rate has not become tiny"""
    own_epochs: int = 0
    """Most passes that the readout itself allows; with fewer `epochs`, training may be cut short"""
    batch: int = 512
    """Windows per step"""
    rate: float = 1e-3
    """Learning rate at first"""
    rises: int = 3
    """Rises of the validation loss in a row that lower the rate"""
    least_rate: float = 1e-6
    """Training stops below this rate"""
    loss: Loss = squared_error
    """The training loss, the published mean squared error"""

    def rate_control(self, net: nn.Module, rows: int) -> "_Rate":
        """The optimizer of a network, and how its rate falls."""
        return _PlateauRate(net, self)


@dataclass(frozen=True)
class OneCycle:
    """Ours: a fixed number of epochs, the rate rising to its peak and falling to zero."""

    epochs: int
    """Passes over the training windows"""
    own_epochs: int = 0
    """Passes that the readout itself sets; with fewer `epochs`, training is cut short"""
    batch: int = 512
    """Windows per step"""
    rate: float = 1e-3
    """Learning rate at its peak"""
    decay: float = 0.0
    """Weight decay (AdamW)"""
    loss: Loss = distance
    """The training loss, the distance that is scored"""

    def rate_control(self, net: nn.Module, rows: int) -> "_Rate":
        """The optimizer of a network, and how its rate rises and falls over the epochs."""
        return _CycleRate(net, self, rows)


def samples(x: Array, y: Array) -> Samples:
    """Samples from inputs and wanted outputs, NaN where unknown."""
    known = np.isfinite(y)
    return Samples(_tensor(x), _tensor(np.where(known, y, 0.0)), _tensor(known))


def _tensor(values: Array) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, np.float32))


def build(make: Callable[[], nn.Module], rng: np.random.Generator) -> nn.Module:
    """The network that `make` gives, its first weights drawn from rng."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(rng.integers(2**31)))
        return make()


def weights(net: nn.Module) -> dict[str, Array]:
    """The network's parameters by name, float32."""
    return {name: value.detach().numpy().copy() for name, value in net.named_parameters()}


def train(
    net: nn.Module,
    data: Samples,
    validation: Samples,
    schedule: Plateau | OneCycle,
    rng: np.random.Generator,
    after_epoch: Callable[[float, float, float, float], None],
) -> None:
    """Train in place, and leave the weights of the best validation loss. `after_epoch` is called with the
    training loss, the validation loss, the learning rate and the wall time [s] of each epoch.
    """
    rate = schedule.rate_control(net, len(data.x))
    shuffle = torch.Generator().manual_seed(int(rng.integers(2**31)))
    epochs, best, best_loss = 0, copy.deepcopy(net.state_dict()), np.inf
    while epochs < schedule.epochs and not rate.spent:
        began = time.perf_counter()
        train_loss = _pass(net, data, schedule, rate, shuffle)
        with torch.inference_mode():
            loss = schedule.loss(net, validation).item()
        spent = rate.value, time.perf_counter() - began
        rate.after_epoch(loss)
        if loss < best_loss:
            best, best_loss = copy.deepcopy(net.state_dict()), loss
        epochs += 1
        after_epoch(train_loss, loss, *spent)
    net.load_state_dict(best)


def _pass(
    net: nn.Module,
    data: Samples,
    schedule: Plateau | OneCycle,
    rate: "_Rate",
    shuffle: torch.Generator,
) -> float:
    total = 0.0
    for rows in torch.randperm(len(data.x), generator=shuffle).split(schedule.batch):
        rate.optimizer.zero_grad()
        loss = schedule.loss(net, Samples(data.x[rows], data.y[rows], data.known[rows]))
        loss.backward()
        rate.optimizer.step()
        rate.after_step()
        total += loss.item() * len(rows)
    return total / len(data.x)


class _Rate:
    """An optimizer and the schedule of its learning rate."""

    optimizer: torch.optim.Optimizer
    spent = False

    @property
    def value(self) -> float:
        """The present learning rate."""
        return self.optimizer.param_groups[0]["lr"]

    def after_step(self) -> None:
        """Called after each batch."""

    def after_epoch(self, loss: float) -> None:
        """Called after each pass with the validation loss."""


class _PlateauRate(_Rate):
    def __init__(self, net: nn.Module, schedule: Plateau) -> None:
        self.schedule, self.last, self.risen = schedule, np.inf, 0
        self.optimizer = torch.optim.Adam(net.parameters(), schedule.rate, fused=True)

    def after_epoch(self, loss: float) -> None:
        self.risen = self.risen + 1 if loss > self.last else 0
        self.last = loss
        if self.risen < self.schedule.rises:
            return
        self.risen = 0
        for group in self.optimizer.param_groups:
            group["lr"] *= 0.1
        self.spent = (
            self.value < self.schedule.least_rate * 0.999
        )  # 1e-3 × 0.1³ is not exactly 1e-6


class _CycleRate(_Rate):
    def __init__(self, net: nn.Module, schedule: OneCycle, rows: int) -> None:
        self.optimizer = torch.optim.AdamW(
            net.parameters(), schedule.rate, weight_decay=schedule.decay, fused=True
        )
        self.cycle = torch.optim.lr_scheduler.OneCycleLR(
            self.optimizer, schedule.rate, total_steps=schedule.epochs * -(-rows // schedule.batch)
        )

    def after_step(self) -> None:
        self.cycle.step()
