"""Suppress the warnings that MuJoCo prints."""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco


@contextmanager
def quietly() -> Iterator[None]:
    """Let MuJoCo print no warnings: for callers who say themselves what became unstable."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
