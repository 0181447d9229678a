"""A reader of `.bsm` version 1 written from the format's description alone."""

import json
import struct
import zlib

import zstandard


def read_bsm(data):
    assert data[:8] == bytes.fromhex("89 42 53 4D 0D 0A 1A 0A")
    at, out = 8, {"levels": [], "path": []}
    while True:
        (length,), kind = struct.unpack_from("<I", data, at), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        assert struct.unpack_from("<I", data, at + 8 + length)[0] == zlib.crc32(kind + body)
        if kind == b"HEAD":
            names = ("major", "minor", "degree", "cap", "level_count", "flags", "curves", "points")
            out |= dict(zip(names, struct.unpack("<HHBBBBII", body), strict=True))
        elif kind == b"META":
            out["meta"] = json.loads(body)
        elif kind == b"LEVL":
            out["levels"].append(read_level(body, out["degree"]))
        elif kind == b"path":
            assert len(body) == 4 + 12 * struct.unpack_from("<I", body)[0]
            out["path"] = list(struct.iter_unpack("<fff", body[4:]))
        elif kind == b"IEND":
            assert struct.unpack("<I", body)[0] == zlib.crc32(data[:at])
            assert at + 12 + length == len(data)
            return out
        at += 12 + length


def read_level(body, degree):
    step, k, n, encoding = struct.unpack_from("<dIIB", body)
    if encoding == 0:
        assert len(body) == 24 + 16 * k + 8 * k + 9 * n
        records = list(struct.iter_unpack("<IffHH", body[24 : 24 + 16 * k]))
        knots = list(struct.iter_unpack("<ii", body[24 + 16 * k : 24 + 24 * k]))
        points = list(struct.iter_unpack("<ff", body[24 + 24 * k : 24 + 24 * k + 8 * n]))
        return step, records, knots, points, list(body[24 + 24 * k + 8 * n :])
    quantum, codec, length = struct.unpack_from("<dB7xI", body, 24)
    unpack = zstandard.ZstdDecompressor().decompress if codec == 1 else zlib.decompress
    block, streams = unpack(body[44:]), []
    assert len(block) == length
    while block:
        size = struct.unpack_from("<I", block)[0]
        streams.append(block[4 : 4 + size])
        block = block[4 + size :]
    taus = struct.unpack(f"<{2 * k}f", streams[1])
    ids, firsts = running(zigzag(streams[0])), running(zigzag(streams[4]))
    flags, seen, counts = varints(streams[2]), varints(streams[3]), varints(streams[5])
    records = list(zip(ids, taus[:k], taus[k:], flags, seen, strict=True))
    xs, ys, weights, at = zigzag(streams[6]), zigzag(streams[7]), zigzag(streams[8]), 0
    points, alphas = [], []
    for count in (knots - degree - 1 for knots in counts):
        x, y = (undo(stream[at : at + count], quantum) for stream in (xs, ys))
        points += zip(x, y, strict=True)
        alphas += running(weights[at : at + count])
        at += count
    assert at == n
    return step, records, list(zip(firsts, counts, strict=True)), points, alphas


def varints(data):
    out, value, shift = [], 0, 0
    for byte in data:
        value, shift = value | (byte & 127) << shift, shift + 7
        if byte < 128:
            out, value, shift = [*out, value], 0, 0
    return out


def zigzag(data):
    return [-(v + 1) // 2 if v & 1 else v // 2 for v in varints(data)]


def running(values):
    return [sum(values[: i + 1]) for i in range(len(values))]


def undo(residuals, quantum):
    out = []
    for g, r in enumerate(residuals):
        out.append(r if g == 0 else out[0] + r if g == 1 else r + 2 * out[g - 1] - out[g - 2])
    return [value * quantum for value in out]
