"""Order the files for workers that share them, and let each compute on one core."""

import os

import pytest

for _library in ("OMP", "OPENBLAS", "MKL"):  # also in the commands that tests start
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")  # the other core has other tests


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the tests by file: those that have slow ones, then the others; within a file as they stand."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    last_first = sorted(
        {item.path for item in items}, key=lambda path: (path.name, path), reverse=True
    )
    place = {path: (path not in slow, n) for n, path in enumerate(last_first)}
    items.sort(key=lambda item: place[item.path])  # test_trace.py leads
