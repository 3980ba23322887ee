"""Define the networks in torch, with the weights named as in `forward`."""

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm
from serpent_twin.arrays import Array
from serpent_twin.extras import requires

with requires("learn", "Training a network"):
    import torch
    from torch import Tensor, nn


class MlpModule(nn.Module):
    """A multilayer perceptron with `layers` hidden layers."""

    def __init__(self, inputs: int, width: int, layers: int, outputs: int, activation: str) -> None:
        super().__init__()
        sizes = [inputs] + [width] * layers + [outputs]
        self.activation = {"relu": nn.ReLU(), "silu": nn.SiLU()}[activation]
        self.count = layers + 1
        for i in range(self.count):
            self.add_module(f"layer{i}", nn.Linear(sizes[i], sizes[i + 1]))

    def forward(self, x: Tensor) -> Tensor:
        """(N, outputs) for inputs (N, inputs)."""
        for i in range(self.count - 1):
            x = self.activation(self.get_submodule(f"layer{i}")(x))
        return self.get_submodule(f"layer{self.count - 1}")(x)


class LstmModule(nn.Module):
    """One LSTM layer that starts from rest, and a linear layer on its last state."""

    def __init__(self, inputs: int, width: int, outputs: int) -> None:
        super().__init__()
        self.input = nn.Linear(inputs, 4 * width)
        self.hidden = nn.Linear(width, 4 * width, bias=False)
        self.output = nn.Linear(width, outputs)
        for layer in (self.input, self.hidden):  # nn.LSTM's own: ±1/√width for every weight
            nn.init.uniform_(layer.weight, -(width**-0.5), width**-0.5)
        nn.init.uniform_(self.input.bias, -(width**-0.5), width**-0.5)

    def forward(self, sequence: Tensor) -> Tensor:
        """(N, outputs) for a sequence (N, H, inputs), oldest first."""
        gates = self.input(sequence).unbind(1)
        cell, hidden = _cell(gates[0], None)
        for gate in gates[1:]:
            cell, hidden = _cell(gate + self.hidden(hidden), cell)
        return self.output(hidden)


def _cell(gate: Tensor, cell: Tensor | None) -> tuple[Tensor, Tensor]:
    let_in, forget, new, out = gate.chunk(4, dim=1)
    fresh = let_in.sigmoid() * new.tanh()
    cell = fresh if cell is None else forget.sigmoid() * cell + fresh
    return cell, out.sigmoid() * cell.tanh()


def markers(q: Tensor, place: Tensor, arm: Arm = ARM) -> Tensor:
    """Marker positions [m], (N, 9, 3), for joint angles q [rad], (N, 9), and places in the links, (9, 3).

    The same as `arm.markers`, differentiable; written for speed as one vector of the chain at a
    time, from the tip: what hangs below joint i is turned by its angle, then moved to joint i.
    """
    cos, sin = q.cos().unsqueeze(2), q.sin().unsqueeze(2)
    length = (0.0, *arm.link_length[:-1])
    below = torch.empty(len(q), 0, 3, dtype=q.dtype)
    for i in reversed(range(N_JOINTS)):
        own = place[i].expand(len(q), 1, 3)
        x, y, z = torch.cat([own, below], dim=1).unbind(2)
        c, s = cos[:, i], sin[:, i]
        if i % 2 == 0:
            turned = (c * x - s * y + length[i], s * x + c * y, z)
        else:
            turned = (c * x + s * z + length[i], y, c * z - s * x)
        below = torch.stack(turned, dim=2)
    return below


class ChainModule(nn.Module):
    """A network's corrections of joint angles, then forward kinematics, then a correction of markers."""

    def __init__(self, network: MlpModule, joint_half: Array, marker_half: Array) -> None:
        super().__init__()
        for i in range(network.count):  # the same names as without a chain
            self.add_module(f"layer{i}", network.get_submodule(f"layer{i}"))
        for value in network.get_submodule(f"layer{network.count - 1}").parameters():
            nn.init.zeros_(value)  # begin with the ridge's angles
        self.nominal = torch.tensor(ARM.markers_in_links, dtype=torch.float32)
        self.place = nn.Parameter(torch.zeros(N_JOINTS, 3))  # in marker_half: Adam's steps are of 1
        self.network = [network]  # in a list, so that its weights are not counted twice
        self.joint_half = torch.tensor(joint_half, dtype=torch.float32)
        self.marker_half = torch.tensor(marker_half, dtype=torch.float32)

    def forward(self, x: Tensor) -> Tensor:
        """Scaled markers (N, 27) for joint angles and features (N, 9 + C)."""
        answer = self.network[0](x[:, N_JOINTS:])
        angle = x[:, :N_JOINTS] + self.joint_half * answer[:, :N_JOINTS]
        place = self.nominal + self.place * self.marker_half.reshape(N_JOINTS, 3)
        return markers(angle, place).flatten(1) / self.marker_half + answer[:, N_JOINTS:]
