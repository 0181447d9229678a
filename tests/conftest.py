"""Shared by all tests."""

import pytest


def pytest_addoption(parser):
    parser.addoption(
        "--rewrite-golden", action="store_true", help="write the golden files anew, then compare"
    )


@pytest.fixture
def rewrite_golden(request):
    return request.config.getoption("--rewrite-golden")
