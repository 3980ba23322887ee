"""Evaluate a trained network in numpy alone, which is faster than torch for one row."""

from collections.abc import Mapping

import numpy as np

from serpent_twin.arrays import Array

Weights = Mapping[str, Array]


def mlp(x: Array, weights: Weights, activation: str) -> Array:
    """Output (N, K) of a multilayer perceptron whose weights are named `layer{i}.weight`, `.bias`."""
    count = sum(name.startswith("layer") for name in weights) // 2
    act = {"relu": relu, "silu": silu}[activation]
    for i in range(count - 1):
        x = act(x @ weights[f"layer{i}.weight"].T + weights[f"layer{i}.bias"])
    return x @ weights[f"layer{count - 1}.weight"].T + weights[f"layer{count - 1}.bias"]


def lstm(sequence: Array, weights: Weights) -> Array:
    """Output (N, K) of one LSTM layer and a linear layer after a sequence (N, H, C), from rest."""
    gates = _by_gate(sequence @ weights["input.weight"].T + weights["input.bias"])
    # One product per gate: a larger one makes BLAS wake its threads, which for one row may take long.
    recurrent = _by_gate(weights["hidden.weight"].T)
    cell, hidden = _cell(gates[:, :, 0], 0.0)
    for k in range(1, sequence.shape[1]):
        cell, hidden = _cell(gates[:, :, k] + hidden @ recurrent, cell)
    return hidden @ weights["output.weight"].T + weights["output.bias"]


def _by_gate(values: Array) -> Array:
    """Columns (..., 4 W) as input, forget, cell and output gate, (4, ..., W)."""
    return np.moveaxis(values.reshape(*values.shape[:-1], 4, -1), -2, 0)


def _cell(gate: Array, cell: Array | float) -> tuple[Array, Array]:
    let_in, forget, new, out = gate
    kept: Array = sigmoid(forget) * cell + sigmoid(let_in) * np.tanh(new)
    return kept, sigmoid(out) * np.tanh(kept)


def relu(x: Array) -> Array:
    """Rectified linear unit, max(x, 0)."""
    return np.maximum(x, 0)


def sigmoid(x: Array) -> Array:
    """Logistic function 1 / (1 + e^−x), by tanh, which does not overflow."""
    return 0.5 * (1 + np.tanh(0.5 * x))


def silu(x: Array) -> Array:
    """Sigmoid linear unit, x / (1 + e^−x)."""
    return x * sigmoid(x)
