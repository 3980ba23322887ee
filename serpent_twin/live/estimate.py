"""Estimate the arm's pose while it moves, from its motor bus alone."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from serpent_twin import estimators
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.feeling import feeling
from serpent_twin.live.arm import Drive, is_known, note, of_readout
from serpent_twin.live.contacts import Contacts
from serpent_twin.live.figures import Course, told
from serpent_twin.live.follower import Follower
from serpent_twin.live.options import Estimate
from serpent_twin.live.run import LivePlan, readout_hashes, run_and_state
from serpent_twin.recording import collect, run_settings
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sim import arm_file, twin_model

SETTINGS = "estimate.json"
RESULTS = "results.json"


def estimate(config: Estimate) -> dict[str, Any]:
    """Drive, estimate and log; returns what results.json holds, also of a run that is stopped."""
    plan = planned(config)
    if plan.note:
        print(plan.note)
    follower = Follower(plan.estimator, config.steps, config.learn, config.prior_runtime_s)
    course, twin = Course(config.steps), plan.estimator.own_twin
    contacts = Contacts(twin.gravity) if config.force and twin else None
    if contacts:
        plan = replace(plan, beside=contacts.beside(follower))
    said = settings(config, plan)
    arm = {"simulated_arm": plan.note, "trained_on_simulated_arm": plan.trained_on_it}

    def found() -> dict[str, Any]:
        return arm | (contacts.found() if contacts else {})

    def tell(results: Mapping[str, Any]) -> None:
        print(told(results))
        if contacts:
            print(contacts.told())

    return run_and_state(plan, follower, course, (SETTINGS, RESULTS), said, found, tell)


def planned(config: Estimate) -> LivePlan:
    """Estimator and arm of a config, checked; nothing is written and nothing moves."""
    trained = estimator = estimators.load(config.model)
    simulated = config.simulate
    if config.twin and trained.takes_twin:
        estimator = trained.with_twin(twin_model.read(config.twin))
    elif config.twin:
        if simulated or config.backend == "real":
            raise SerpentError(
                f"--twin {config.twin}: the readout {estimator.name} in {config.model} has no twin that "
                "could be replaced. Leave --twin out, or give a trained observer as --model."
            )
        simulated = config.twin
    if config.prior_runtime_h and config.backend == "real" and estimator.own_twin is None:
        raise SerpentError(
            f"--prior-runtime-h would be ignored: the readout {estimator.name} has no twin that could wear. "
            "Leave it out."
        )
    if config.backend == "sim":
        arm_file.read(simulated, config.parameters, "--simulate")
    given = {"twin": simulated, "parameters": config.parameters, "push": config.push}
    drive = of_readout(Drive.of(config, steps=config.steps, **given), trained)
    collect.check(drive)
    estimator.require_rate(config.rate_hz)
    if config.force:
        estimator = feeling(estimator)
    if config.backend == "real":
        return LivePlan(estimator, drive)
    other = f" It estimates by {config.twin}." if config.twin and trained.takes_twin else ""
    return LivePlan(estimator, drive, note(drive, trained) + other, is_known(drive, trained))


def settings(config: Estimate, plan: LivePlan) -> dict[str, Any]:
    """The options of the run, and the hashes of its input files."""
    return run_settings.settings(plan.drive) | {
        "readout": plan.estimator.name,
        "readout_sha256": readout_hashes(config.model),
        "twin_sha256": config.twin and file_hash(config.twin),
        "simulate_sha256": config.simulate and file_hash(config.simulate),
        "learn": config.learn,
        "force": config.force,
        "prior_runtime_h": config.prior_runtime_h,
        "markers": config.real.mocap if config.backend == "real" else config.markers,
    }
