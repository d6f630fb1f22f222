"""Every study in its quick version, run once and judged by several tests."""

from functools import cache

import pytest

from evfem import studies


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """name -> the quick study of that name, and the folder that it has left."""

    @cache
    def run(name):
        folder = tmp_path_factory.mktemp(name)
        return studies.run(name, quick=True, out=folder), folder

    return run


@pytest.fixture(scope="session")
def numbers_of(study):
    """name -> the numbers of the quick study of that name."""
    return lambda name: study(name)[0]["numbers"]
