"""A map is known from its content."""

import io

import pytest

from bsmap_cli.errors import MapFileError
from bsmap_cli.exchange.map_json import write_map_json
from bsmap_cli.exchange.map_reading import read_any_map
from bsmap_cli.mapping.map_file import write_map
from tests.exchange.exported import written
from tests.mapping.test_map_file import Drip, assert_same
from tests.maps import room_document


@pytest.mark.parametrize("stream", [io.BytesIO, Drip])
def test_both_kinds_are_read_with_the_same_sizes(stream):
    document = room_document()
    binary = written(write_map, document)
    found, sizes = read_any_map(stream(binary))
    assert_same(found, document)
    assert sizes.file_bytes == len(binary)


def test_json_has_the_sizes_of_its_twin():
    document = room_document()
    found, sizes = read_any_map(io.BytesIO(written(write_map_json, document)))
    assert_same(found, document)
    assert sizes.file_bytes == len(written(write_map, document))


@pytest.mark.parametrize("data", [b"", b"x", b"{", b"{}", b"\x89BSM"])
def test_what_is_neither(data):
    with pytest.raises(MapFileError):
        read_any_map(io.BytesIO(data))
