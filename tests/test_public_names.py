"""Test that the package imports quickly, and that its public names exist."""

import subprocess
import sys

import serpent_twin

HEAVY = ("torch", "rerun", "mujoco", "dask", "matplotlib", "numpy")


def test_the_package_is_imported_without_anything_heavy():
    code = f"import sys, serpent_twin; print([n for n in {HEAVY} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_every_public_name_is_there_and_documented():
    for name in serpent_twin.__all__:
        thing = getattr(serpent_twin, name)
        assert name in dir(serpent_twin)
        assert not callable(thing) or thing.__doc__
    code = "from serpent_twin import *; print(SimulatedBus.__name__, read_session.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "SimulatedBus read_session\n"


def test_what_is_not_there_is_no_attribute():
    assert not hasattr(serpent_twin, "gripper")
