"""Negative evidence: which spans of the map a scan sees, and through which it looks.

A beam that ends on a span is a hit. One that passes it and comes back from well behind is a
miss. One that ends before it says nothing, and neither does anything that an error of the pose by
a few centimetres may explain: grazing incidence, and spans beside which some beam ends near or
before them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean, lean_part
from bsmap_cli.geometry.se2 import Points, Vector, wrap_angle
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.sensor.sight import Sight

UNSEEN, HIT, MISS, DARK = 0, 1, 2, 3  # DARK: no beam came back from there, nor from behind

LEAST_COSINE = 0.35  # of the incidence under which a span is judged: 70 degrees from its normal
ON_SPAN = 0.3  # a beam that ends this near the span hits it [knot steps]
BEHIND = 1.0  # a beam that ends this far behind has passed it [knot steps]
BESIDE = 1.0  # no beam this far beside a missed span may end near it [knot steps]
HEADING = 0.01  # error of the heading that explains what is seen [rad]
SECTORS = 128  # in which the fan of beams is summed up, to pass over what lies behind walls
WIDTHS = 5  # 2^0 .. 2^4 sectors to either side
GROUP = 16  # spans that are looked for together

Ranges = NDArray[np.float32]


class Fan(NamedTuple):
    """The beams of one scan in the map frame.

    x, y, first_rad : the laser and the bearing of its first beam; turn_cos, turn_sin : of the
    step from one beam to the next; circle : beams of a whole turn; farthest : (WIDTHS, SECTORS) the
    longest beam within 2^w sectors to either side, -1 without any.
    """

    x: float
    y: float
    first_rad: float
    step_rad: float
    turn_cos: float
    turn_sin: float
    circle: int
    ranges_m: Ranges
    reach_m: float
    farthest: Points
    sigma_m: float


class Look(NamedTuple):
    """What one scan shows of a map: the spans of which it tells anything, by row.

    verdicts : HIT, MISS or DARK; cosines : of the incidence; ranges_m : distance of the span.
    reach_m : of the longest beam that came back.
    """

    rows: NDArray[np.int32]
    verdicts: NDArray[np.int8]
    cosines: NDArray[np.float32]
    ranges_m: NDArray[np.float32]
    reach_m: float


@inlined
def _sector(x: float, y: float) -> int:
    """Sector of a direction: steps of a square's outline, nearly even in angle, without atan2."""
    turn = y / (abs(x) + abs(y) + 1e-300)
    if x < 0.0:
        turn = 2.0 - turn
    elif y < 0.0:
        turn += 4.0
    return min(SECTORS - 1, int(turn * (SECTORS / 4.0)))


@lean_part
def _find_farthest(
    first_rad: float, step_rad: float, ranges: Ranges, sectors: Vector, farthest: Points
) -> None:
    """Write the longest beam in each of the sectors, and within 2^w of them to either side."""
    for s in range(SECTORS):
        sectors[s] = -1.0
    cos, sin = math.cos(first_rad), math.sin(first_rad)
    turn_cos, turn_sin = math.cos(step_rad), math.sin(step_rad)
    for b in range(len(ranges)):
        if not math.isnan(ranges[b]):
            s = _sector(cos, sin)
            sectors[s] = max(sectors[s], float(ranges[b]))
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
    for s in range(SECTORS):
        farthest[0, s] = max(sectors[s - 1], sectors[s], sectors[(s + 1) % SECTORS])
    for w in range(1, WIDTHS):
        reach = 1 << (w - 1)
        for s in range(SECTORS):
            left, right = farthest[w - 1, s - reach], farthest[w - 1, (s + reach) % SECTORS]
            farthest[w, s] = max(left, right)


@lean_part
def _in_sight(x: float, y: float, radius_m: float, fan: Fan) -> bool:
    """Does any beam come near a part of a curve that lies round (x, y)?"""
    vx, vy = x - fan.x, y - fan.y
    r = math.sqrt(vx * vx + vy * vy)
    if r > fan.reach_m + radius_m:
        return False
    if r < 2.0 * radius_m:
        return True
    wide = 0.25 * SECTORS * radius_m / r  # at least: a radian is SECTORS / 2 pi of them
    w = 0
    while 1 << w < wide:
        w += 1
    return bool(fan.farthest[w, _sector(vx, vy)] > r - 2.0 * radius_m)


@lean_part
def _judge_beams(
    fan: Fan,
    centre: float,
    half_width: float,
    cosine: float,
    sine: float,
    height: float,
    near: float,
    far: float,
) -> int:
    """HIT where a beam within the window ends on a line; MISS or DARK where all go past it.

    centre : number of the beam that would meet the line with this incidence; height : of the
    laser over the line.
    """
    first, last = math.ceil(centre - half_width), math.floor(centre + half_width)
    angle = (first - centre) * fan.step_rad
    cos, sin = math.cos(angle), math.sin(angle)
    slope, across = cosine * cos - sine * sin, sine * cos + cosine * sin
    passed = dark = 0
    for number in range(first, last + 1):
        beam = number
        if number < 0:
            beam += fan.circle
        elif number >= len(fan.ranges_m):
            beam -= fan.circle
        if slope < 0.1 or beam < 0 or beam >= len(fan.ranges_m):
            return UNSEEN
        depth = fan.ranges_m[beam] * slope - height  # of the beam's end behind the line
        if abs(depth) <= near:
            return HIT
        if not depth > far:  # before it, or too near behind it, or it says nothing
            return UNSEEN
        if depth == math.inf:
            dark += 1
        else:
            passed += 1
        slope, across = (
            slope * fan.turn_cos - across * fan.turn_sin,
            across * fan.turn_cos + slope * fan.turn_sin,
        )
    if passed > 0:
        return MISS
    return DARK if dark > 0 else UNSEEN


@lean_part
def _judge_span(spans: Points, row: int, fan: Fan, knot_step_m: float) -> tuple[int, float, float]:
    """UNSEEN, HIT, MISS or DARK; cosine of the incidence; distance [m]."""
    vx, vy = spans[row, 0] - fan.x, spans[row, 1] - fan.y
    hx, hy = spans[row, 2], spans[row, 3]
    facing = hy * vx - hx * vy  # the free side is on the left of the chord
    r2, half2 = vx * vx + vy * vy, hx * hx + hy * hy
    within = facing > 0.0 and knot_step_m * knot_step_m < r2 < fan.reach_m * fan.reach_m
    if not within or facing * facing < LEAST_COSINE * LEAST_COSINE * r2 * half2:
        return UNSEEN, 0.0, 0.0
    r, half = math.sqrt(r2), math.sqrt(half2)
    near = 3.0 * fan.sigma_m + ON_SPAN * knot_step_m
    if fan.farthest[0, _sector(vx, vy)] < r - near / LEAST_COSINE:
        return UNSEEN, 0.0, 0.0
    height = facing / half
    cosine, sine = height / r, (hx * vx + hy * vy) / (half * r)
    near *= min(1.0, 2.0 * cosine)  # along the beam, too, it must end near
    far = 3.0 * fan.sigma_m + BEHIND * knot_step_m + HEADING * r * abs(sine)
    bearing = math.atan2(vy, vx) - fan.first_rad
    centre = (bearing if bearing >= 0.0 else bearing + math.tau) / fan.step_rad
    inner = half * cosine / (r * fan.step_rad)
    verdict = _judge_beams(fan, centre, inner, cosine, sine, height, near, far)
    if verdict in (MISS, DARK):
        outer = inner + (BESIDE * knot_step_m / r + HEADING) / fan.step_rad
        beside = _judge_beams(fan, centre, outer, cosine, sine, height, near, far)
        if beside in (UNSEEN, HIT):
            verdict = UNSEEN
    return verdict, cosine, r


@lean
def _judge_level(
    level: LevelArrays,
    degree: int,
    knot_step_m: float,
    laser: Vector,
    step_rad: float,
    ranges: Ranges,
    reach_m: float,
    sigma_m: float,
    sectors: Vector,
    farthest: Points,
    look: Look,
) -> int:
    """Judge all spans that the beams may reach, and write of how many; laser as in `Fan`."""
    _find_farthest(laser[2], step_rad, ranges, sectors, farthest)
    fan = Fan(
        laser[0],
        laser[1],
        laser[2],
        step_rad,
        math.cos(step_rad),
        math.sin(step_rad),
        round(math.tau / step_rad),
        ranges,
        reach_m,
        farthest,
        sigma_m,
    )
    count = 0
    radius = 0.5 * (GROUP + degree + 2) * knot_step_m
    for curve in range(level.sizes[0]):
        offset = level.offset[curve]
        spans = level.count[curve] - degree
        for begin in range(offset, offset + spans, GROUP):
            end = min(begin + GROUP, offset + spans)
            middle = (begin + end + degree) // 2
            if not _in_sight(level.points[middle, 0], level.points[middle, 1], radius, fan):
                continue
            for row in range(begin, end):
                if level.span_cell[row] < 0:
                    continue
                verdict, cosine, r = _judge_span(level.spans, row, fan, knot_step_m)
                if verdict != UNSEEN:
                    look.rows[count] = row
                    look.verdicts[count] = verdict
                    look.cosines[count] = cosine
                    look.ranges_m[count] = r
                    count += 1
    return count


def look_at(curve_map: CurveMap, sight: Sight, pose_map_body: Vector, sigma_m: float) -> Look:
    """What one scan shows of the spans of a map."""
    x, y, theta = pose_map_body
    cos, sin = math.cos(theta), math.sin(theta)
    lx, ly, bearing = sight.laser
    laser = np.array(
        [x + cos * lx - sin * ly, y + sin * lx + cos * ly, wrap_angle(theta + bearing)]
    )
    most = int(curve_map.arrays.sizes[1])
    room = Look(
        np.empty(most, np.int32),
        np.empty(most, np.int8),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        sight.reach_m,
    )
    count = _judge_level(
        curve_map.arrays,
        curve_map.degree,
        curve_map.knot_step_m,
        laser,
        sight.beam_step_rad,
        sight.ranges_m,
        room.reach_m,
        sigma_m,
        np.empty(SECTORS),
        np.empty((WIDTHS, SECTORS)),
        room,
    )
    return Look(
        room.rows[:count].copy(),
        room.verdicts[:count].copy(),
        room.cosines[:count].copy(),
        room.ranges_m[:count].copy(),
        room.reach_m,
    )
