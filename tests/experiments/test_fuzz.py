"""Test that damaged input is read or refused, and nothing else."""

import numpy as np
import pytest

from experiments import fuzz


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    return {each.name: each for each in fuzz.sources(tmp_path_factory.mktemp("samples"))}


def test_good_samples_of_every_source_are_read(sources):
    assert len(sources) > 10
    for source in sources.values():
        for sample in source.samples:
            source.read(sample)


def test_mutants_of_every_source_are_read_or_refused(sources, tmp_path):
    rng = np.random.default_rng(1)
    counts = {name: fuzz.examined(each, 200, rng, tmp_path) for name, each in sources.items()}
    assert {name: count["other"] for name, count in counts.items() if count["other"]} == {}
    assert sum(count["refused"] for count in counts.values()) > 1000
