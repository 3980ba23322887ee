"""Files with slow tests come first, so that workers which share the files end together."""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the tests by file: those that have slow ones, then the others; within a file as they stand."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    longest_first = sorted({item.path for item in items}, reverse=True)  # test_trace.py leads
    items.sort(key=lambda item: (item.path not in slow, longest_first.index(item.path)))
