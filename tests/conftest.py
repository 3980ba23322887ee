"""Files with slow tests come first, so that workers which share the files end together."""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the tests by file: those that have slow ones, then the others; within a file as they stand."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    last_first = sorted({item.path for item in items}, key=lambda path: path.name, reverse=True)
    place = {
        path: (path not in slow, n) for n, path in enumerate(last_first)
    }  # test_trace.py leads
    items.sort(key=lambda item: place[item.path])
