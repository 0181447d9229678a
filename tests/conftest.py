"""Shared by all tests."""

import hypothesis
import pytest

# how long one example takes says nothing about the law it tests
hypothesis.settings.register_profile("no deadline", hypothesis.settings.default, deadline=None)
hypothesis.settings.load_profile("no deadline")


def pytest_addoption(parser):
    parser.addoption(
        "--rewrite-golden", action="store_true", help="write the golden files anew, then compare"
    )


@pytest.fixture
def rewrite_golden(request):
    return request.config.getoption("--rewrite-golden")
