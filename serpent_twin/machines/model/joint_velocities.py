"""Measure joint velocities by sensors of the model, which are compared as all others are."""

import mujoco
from msgspec.structs import replace

from serpent_twin.machines.model.description import Description, MeasuredColumns


def with_velocity_sensors(
    spec: mujoco.MjSpec, about: Description, model: mujoco.MjModel
) -> Description:
    """A description in which sensors `jointvel` of the model read each measured velocity of a joint: those
    that it has, or new ones.
    """
    taken = {each.sensor for each in about.measured}
    measured = list[MeasuredColumns]()
    for each in about.measured:
        if each.joint and each.of_velocity:
            sensor = _free_sensor(model, each.joint, taken) or _added(spec, each.joint)
            taken.add(sensor)
            measured.append(replace(each, joint="", sensor=sensor))
        else:
            measured.append(each)
    return replace(about, measured=tuple(measured))


def _free_sensor(model: mujoco.MjModel, joint: str, taken: set[str]) -> str:
    """Name of the model's sensor of a joint's velocity that nothing else reads; nothing without any. One that
    delays, filters or cuts what it reads is none.
    """
    for n in range(model.nsensor):
        sensor = model.sensor(n)
        plain = not (model.sensor_delay[n] or model.sensor_history[n, 0] or model.sensor_cutoff[n])
        if (
            model.sensor_type[n] == mujoco.mjtSensor.mjSENS_JOINTVEL
            and model.sensor_objid[n] == model.joint(joint).id
            and sensor.name
            and sensor.name not in taken
            and plain
        ):
            return str(sensor.name)
    return ""


def _added(spec: mujoco.MjSpec, joint: str) -> str:
    """Add a sensor of a joint's velocity to a spec; returns its name, which is new there."""
    name = f"{joint}_velocity"
    while any(each.name == name for each in spec.sensors):
        name += "_"
    spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_JOINTVEL,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        objname=joint,
    )
    return name
