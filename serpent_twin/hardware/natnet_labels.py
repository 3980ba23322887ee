"""Find the arm's markers among Motive's labelled markers."""

import re
from collections.abc import Sequence

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.hardware.natnet_packets import Id
from serpent_twin.hardware.natnet_reading import Model
from serpent_twin.numerals import counted


def ids_by_name(models: Sequence[Model]) -> dict[str, Id]:
    """(model, marker) ids by `name` and `model:name`, from Motive's description of its models."""
    known = {each.name for each in models if each.model >= 0} | {"all"}
    named = [each for each in models if each.model >= 0 or each.name not in known]
    return {
        key: (each.model, marker)
        for each in sorted(named, key=lambda each: each.model < 0)
        for label, marker in each.markers
        for key in (label, f"{each.name}:{label}")
    }


def chosen(labels: Sequence[str], seen: Sequence[Id], names: dict[str, Id]) -> list[Id] | str:
    """The ids of markers 1 … 9, or why there are none."""
    listed = ", ".join(f"{model}:{marker}" for model, marker in seen) or "none"
    if not labels:
        models = {model for model, _ in seen}
        nine = [m for m in models if sum(key[0] == m for key in seen) == N_JOINTS]
        if len(nine) == 1:
            return [key for key in seen if key[0] == nine[0]]
        return f"no one asset has nine labelled markers (seen: {listed}); name them with --labels"
    if len(labels) != N_JOINTS:
        return f"{counted(len(labels), 'label was', 'labels were')} given, nine are needed"
    ids = [_id(label, seen, names) for label in labels]
    missing = [label for label, key in zip(labels, ids, strict=True) if key is None]
    if missing:
        known = ", ".join(n for n in names if ":" not in n) or "no names"
        return f"its stream has no marker {', '.join(missing)} (seen: {listed}; {known})"
    return [key for key in ids if key]


def _id(label: str, seen: Sequence[Id], names: dict[str, Id]) -> Id | None:
    if re.fullmatch(r"\d+:\d+", label):
        model, marker = map(int, label.split(":"))
        return (model, marker) if (model, marker) in seen else None
    model, marker = names.get(label, (0, 0))
    if marker and model < 0:  # a marker set has names but no id: it must be the only model seen
        models = {key[0] for key in seen}
        model = models.pop() if len(models) == 1 else -1
    return (model, marker) if (model, marker) in seen else None
