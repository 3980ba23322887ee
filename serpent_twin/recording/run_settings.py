"""State what the files of a run say of it."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from serpent_twin.recording.options import Collect
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.sessions import SCHEMA_VERSION
from serpent_twin.sim import twin_model


def session_path(config: Collect, session: int) -> Path:
    """Where session 1, 2, … of a run lies."""
    return config.out / f"session_{session:02d}.parquet"


def metadata(config: Collect, session: int) -> dict[str, Any]:
    """The metadata of a session's file."""
    said = settings(config)
    return (
        {
            "schema_version": SCHEMA_VERSION,
            "backend": config.backend,
            "arm": config.arm_name,
            "session": session,
            "rate_hz": config.rate_hz,
            "seed": config.seed,
            "config": said,
        }
        | _twin_file(config, said)
        | provenance()
    )


def settings(config: Collect) -> dict[str, Any]:
    """The settings that runs in one folder must share."""
    common = {name: getattr(config, name) for name in ("backend", "rate_hz", "seed")}
    common["steps"] = config.rows
    if config.motion:
        common["motion_sha256"] = file_hash(config.motion)
    common["arm"] = config.arm_name
    if config.backend == "real":
        from serpent_twin.recording.real_arm import settings_of_arm

        return common | settings_of_arm(config)
    arm = config.simulated()
    if config.push:
        random = config.random_pushes
        common["push"] = file_hash(Path(config.push)) if random is None else random
    return common | {
        "marker_loss": config.marker_loss,
        "parameters": asdict(arm.design.parameters),
        "model_sha256": arm.fingerprint,
    }


def _twin_file(config: Collect, said: dict[str, Any]) -> dict[str, Any]:
    """The file of the arm; the model's hash is also of what an MJCF file includes."""
    if config.twin is None:
        return {}
    hashes = {"sha256": file_hash(config.twin), "model_sha256": said["model_sha256"]}
    about, arm = {"path": str(config.twin)} | hashes, config.simulated()
    return {"twin": about if arm.model else about | {"design": twin_model.to_dict(arm.design)}}
