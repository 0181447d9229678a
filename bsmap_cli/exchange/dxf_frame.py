"""What a DXF file of AutoCAD 2000 must hold round its entities: header, tables, blocks, objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bsmap_cli.geometry.se2 import Points

Tag = tuple[int, str]
Tags = list[Tag]

VERSION = "AC1015"
METRES = "6"
MODEL_SPACE, PAPER_SPACE = "1F", "1E"  # handles of the block records
ROOT, GROUPS = "C", "D"
LAYER_COLOURS = (7, 5, 3, 30, 1)


class Handles:
    """Numbers for objects, each used once; low ones belong to the fixed objects."""

    SEED_MARK = "@handseed@"

    def __init__(self) -> None:
        self._last = 0xFF

    def next(self) -> str:
        """A handle that nothing else has."""
        self._last += 1
        return f"{self._last:X}"

    def behind(self, count: int) -> str:
        """The handle that `next` gives once so many more have been given."""
        return f"{self._last + count + 1:X}"


def frame_head(
    layers: Sequence[str], extent: tuple[Points, Points], handles: Handles
) -> Iterator[Tag]:
    """All tags before the first entity."""
    low, high = extent
    yield from ((0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, VERSION))
    yield from ((9, "$HANDSEED"), (5, Handles.SEED_MARK), (9, "$INSUNITS"), (70, METRES))
    yield from ((9, "$MEASUREMENT"), (70, "1"))
    for name, corner in (("$EXTMIN", low), ("$EXTMAX", high)):
        yield from ((9, name), (10, f"{corner[0]:.6f}"), (20, f"{corner[1]:.6f}"), (30, "0.0"))
    yield (0, "ENDSEC")
    yield from ((0, "SECTION"), (2, "CLASSES"), (0, "ENDSEC"))
    yield from ((0, "SECTION"), (2, "TABLES"))
    yield from _tables(layers, handles)
    yield from ((0, "ENDSEC"), (0, "SECTION"), (2, "BLOCKS"))
    yield from _block("*Model_Space", MODEL_SPACE, handles)
    yield from _block("*Paper_Space", PAPER_SPACE, handles)
    yield from ((0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES"))


def frame_tail(handles: Handles) -> Iterator[Tag]:
    """All tags behind the last entity."""
    yield from ((0, "ENDSEC"), (0, "SECTION"), (2, "OBJECTS"))
    yield from ((0, "DICTIONARY"), (5, ROOT), (330, "0"), (100, "AcDbDictionary"), (281, "1"))
    yield from ((3, "ACAD_GROUP"), (350, GROUPS))
    yield from ((0, "DICTIONARY"), (5, GROUPS), (330, ROOT), (100, "AcDbDictionary"), (281, "1"))
    yield from ((0, "ENDSEC"), (0, "EOF"))


def _tables(layers: Sequence[str], handles: Handles) -> Iterator[Tag]:
    yield from _table("VPORT", "8", [])
    line_types = [
        [*_record("LTYPE", "AcDbLinetypeTableRecord", name, "5", handles), *_solid()]
        for name in ("ByBlock", "ByLayer", "Continuous")
    ]
    yield from _table("LTYPE", "5", line_types)
    colours = [LAYER_COLOURS[k % len(LAYER_COLOURS)] for k in range(len(layers))]
    layer_records = [
        [
            *_record("LAYER", "AcDbLayerTableRecord", name, "2", handles),
            (62, str(colour)),
            (6, "Continuous"),
            (370, "-3"),
        ]
        for name, colour in zip(("0", *layers), (7, *colours), strict=True)
    ]
    yield from _table("LAYER", "2", layer_records)
    style = _record("STYLE", "AcDbTextStyleTableRecord", "Standard", "3", handles)
    shape = [(40, "0.0"), (41, "1.0"), (50, "0.0"), (71, "0"), (42, "2.5"), (3, "txt"), (4, "")]
    yield from _table("STYLE", "3", [[*style, *shape]])
    yield from _table("VIEW", "6", [])
    yield from _table("UCS", "7", [])
    applications = [
        _record("APPID", "AcDbRegAppTableRecord", name, "9", handles) for name in ("ACAD", "BSMAP")
    ]
    yield from _table("APPID", "9", applications)
    yield from _table("DIMSTYLE", "A", [], extra=[(100, "AcDbDimStyleTable"), (71, "0")])
    yield from _table(
        "BLOCK_RECORD",
        "1",
        [
            _block_record("*Model_Space", MODEL_SPACE),
            _block_record("*Paper_Space", PAPER_SPACE),
        ],
    )


def _table(
    name: str, handle: str, records: Sequence[Sequence[Tag]], extra: Sequence[Tag] = ()
) -> Iterator[Tag]:
    yield from ((0, "TABLE"), (2, name), (5, handle), (330, "0"), (100, "AcDbSymbolTable"))
    yield (70, str(len(records)))
    yield from extra
    for record in records:
        yield from record
    yield (0, "ENDTAB")


def _record(kind: str, subclass: str, name: str, table: str, handles: Handles) -> Tags:
    return [
        (0, kind),
        (5, handles.next()),
        (330, table),
        (100, "AcDbSymbolTableRecord"),
        (100, subclass),
        (2, name),
        (70, "0"),
    ]


def _solid() -> Tags:
    return [(3, ""), (72, "65"), (73, "0"), (40, "0.0")]


def _block_record(name: str, handle: str) -> Tags:
    return [
        (0, "BLOCK_RECORD"),
        (5, handle),
        (330, "1"),
        (100, "AcDbSymbolTableRecord"),
        (100, "AcDbBlockTableRecord"),
        (2, name),
        (340, "0"),
    ]


def _block(name: str, owner: str, handles: Handles) -> Iterator[Tag]:
    yield from ((0, "BLOCK"), (5, handles.next()), (330, owner), (100, "AcDbEntity"), (8, "0"))
    yield from ((100, "AcDbBlockBegin"), (2, name), (70, "0"))
    yield from ((10, "0.0"), (20, "0.0"), (30, "0.0"), (3, name), (1, ""))
    yield from ((0, "ENDBLK"), (5, handles.next()), (330, owner), (100, "AcDbEntity"), (8, "0"))
    yield (100, "AcDbBlockEnd")
