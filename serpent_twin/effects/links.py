"""Find places along the straight arm in a spec."""

import mujoco
import numpy as np


def link_at(spec: mujoco.MjSpec, place: float) -> tuple[mujoco.MjsBody, float]:
    """The link at a distance from joint 1 along the straight arm [m], and where along it that is [m]; of a
    link that bends or twists, the half that holds the link's joint.
    """
    links = [body for body in spec.bodies if body.name.startswith("link")]
    begins = np.cumsum([0.0, *(link.pos[0] for link in links[1:])])
    at = max(place, 0.0)
    carrier = int(np.searchsorted(begins, at, side="right")) - 1
    return links[carrier], at - float(begins[carrier])


def last_joint(spec: mujoco.MjSpec) -> float:
    """Distance of the last joint from joint 1 along the straight arm [m]."""
    links = [body for body in spec.bodies if body.name.startswith("link")]
    return float(sum(link.pos[0] for link in links[1:]))
