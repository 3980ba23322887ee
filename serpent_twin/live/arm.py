"""Choose the arm that a live estimate simulates, and state whether the readout was trained on that arm."""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.estimators import Estimator
from serpent_twin.numerals import counted
from serpent_twin.recording.options import Collect
from serpent_twin.sim.arm_file import ArmFile
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

_SHARED = ("out", "backend", "rate_hz", "seed", "arm", "real", "markers", "record", "view")


@dataclass(frozen=True)
class Drive(Collect):
    """What moves: an arm as `collect` has it, or an estimator's own twin."""

    own: TwinModel | None = None
    """The estimator's own twin, simulated in place of `twin` and `parameters`"""
    prior_runtime: float = 0.0
    """How long the arm ran before its session 1 [s]"""
    readout: Path | None = None
    """Folder of the trained readout that estimates, if it is one"""
    markers: bool = True
    """Whether simulated cameras measure"""
    record: bool = True
    """Whether a recording is written"""
    view: bool = False
    """Whether the viewer shows it"""

    @classmethod
    def of(cls, config: Any, **more: Any) -> Self:
        """The drive of the options that all live commands have, as `Estimate` explains them."""
        return cls(
            sessions=1,
            prior_runtime=config.prior_runtime_s,
            readout=config.model,
            **{name: getattr(config, name) for name in _SHARED},
            **more,
        )

    def simulated(self) -> ArmFile:
        """The arm to simulate."""
        return ArmFile(self.own) if self.own else super().simulated()


def of_readout(drive: Drive, estimator: Estimator) -> Drive:
    """Make a drive simulate the estimator's own twin, if it has one and no other arm is named."""
    named = drive.backend == "real" or drive.twin or drive.parameters != NOMINAL
    return drive if named else replace(drive, own=estimator.own_twin)


def is_known(drive: Drive, estimator: Estimator) -> bool | None:
    """Whether the arm is the estimator's own twin or, of one without, the arm of its logs; None if that is
    not known.
    """
    fingerprint = drive.simulated().fingerprint
    if estimator.own_twin is not None:
        return estimator.own_twin.fingerprint() == fingerprint
    models = {each.model_sha256 for each in estimator.trained.trained_on}
    return fingerprint in models if models else None


def note(drive: Drive, estimator: Estimator) -> str:
    """Which arm is simulated, and what that means for the errors."""
    name, same = estimator.name, is_known(drive, estimator)
    arm, trained = f"The simulated arm is {_called(drive)}", _trained_on(estimator)
    if drive.own:
        return f"The simulated arm is {name}'s own twin{trained}; --simulate names another."
    if same is None:
        return f"{arm}. It is not known on which arm's logs {name} was trained."
    its = f"{name}'s own twin" if estimator.own_twin else f"the arm that {name} was trained on"
    if same:
        return f"{arm}, {its}."
    return f"{arm}, not {its}{trained}: the errors are those of a readout on another arm."


def _called(drive: Drive) -> str:
    if drive.twin:
        return f"that of {drive.twin}"
    nominal = drive.simulated().design == NOMINAL_TWIN
    return "the nominal one" if nominal else "that of the given parameters"


def _trained_on(estimator: Estimator) -> str:
    """How many logs of which arms, in brackets."""
    logs = {each.readings_sha256: each.arm for each in estimator.trained.trained_on}
    count = sorted(Counter(logs.values()).items())
    told = [f"{counted(n, 'session')} of {arm or 'an arm without a name'}" for arm, n in count]
    return f" (trained on {' and '.join(told)})" if told else ""
