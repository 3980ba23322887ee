"""Every kind of stored file, with its reader."""

import pytest
from stored_files import READERS


@pytest.fixture(params=READERS)
def reader(request):
    return READERS[request.param]


@pytest.fixture
def path(reader, tmp_path):
    return reader.make(tmp_path)
