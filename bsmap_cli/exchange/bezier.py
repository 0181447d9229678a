"""Spans as Bezier segments: exact for degrees 2 and 3, within 0.1 mm for 4 and 5."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.exchange.flatten import spans_of
from bsmap_cli.exchange.selection import SelectedLevel
from bsmap_cli.geometry.basis import basis_matrix

TOLERANCE_M = 5e-5
CHECKS = 17  # parameters at which an approximation is compared with its span

Polynomials = NDArray[np.float64]  # (s, d + 1, 2), coefficients of f^p


def bezier_pieces(selected: SelectedLevel) -> list[NDArray[np.float64]]:
    """For each piece (s, e + 1, 2) control points of s segments that join, each of degree e.

    A uniform span is a polynomial, hence a Bezier segment; the first and the last one of a piece
    are cut where the piece begins and ends. Degrees above 3 become cubics that keep within 0.1 mm.
    """
    piece, polynomials = span_polynomials(selected)
    if selected.level.degree <= 3:
        segments = _bernstein(polynomials)
    else:
        cuts = _cuts_for_cubics(polynomials)
        piece, polynomials = np.repeat(piece, cuts), _cut(polynomials, cuts)
        segments = _hermite(polynomials)
    ends = np.cumsum(np.bincount(piece, minlength=len(selected.pieces.curve)))
    return list(np.split(segments, ends[:-1]))[: len(ends)]


def span_polynomials(selected: SelectedLevel) -> tuple[NDArray[np.int64], Polynomials]:
    """The piece each drawn part of a span belongs to, and its polynomial over [0, 1]."""
    level = selected.level
    piece, span, begin, end = spans_of(selected)
    row = level.offsets()[selected.pieces.curve[piece]] + span
    active = level.control_points.astype(np.float64)[row[:, None] + np.arange(level.degree + 1)]
    polynomials = np.einsum("ap,sac->spc", basis_matrix(level.degree), active)
    return piece, _reparametrised(polynomials, begin - span, end - begin)


def _reparametrised(
    polynomials: Polynomials, start: NDArray[np.float64], width: NDArray[np.float64]
) -> Polynomials:
    """The polynomials in t, f = start + width t."""
    degree = polynomials.shape[1] - 1
    moved = np.zeros_like(polynomials)
    for q in range(degree + 1):
        for p in range(q, degree + 1):
            moved[:, q] += (comb(p, q) * start ** (p - q))[:, None] * polynomials[:, p]
        moved[:, q] *= (width**q)[:, None]
    return moved


def _bernstein(polynomials: Polynomials) -> NDArray[np.float64]:
    """Control points of the same polynomials in Bezier form."""
    degree = polynomials.shape[1] - 1
    matrix = [
        [comb(j, p) / comb(degree, p) if p <= j else 0.0 for p in range(degree + 1)]
        for j in range(degree + 1)
    ]
    return np.asarray(np.einsum("jp,spc->sjc", np.array(matrix), polynomials))


def _hermite(polynomials: Polynomials) -> NDArray[np.float64]:
    """Cubic segments with the ends and the end velocities of the polynomials."""
    order = np.arange(polynomials.shape[1])[:, None]
    start, end = polynomials[:, 0], polynomials.sum(axis=1)
    leave, arrive = polynomials[:, 1] / 3.0, (polynomials * order).sum(axis=1) / 3.0
    return np.stack((start, start + leave, end - arrive, end), axis=1)


def _cuts_for_cubics(polynomials: Polynomials) -> NDArray[np.int64]:
    """Into how many equal parts each polynomial must be cut for cubics to follow it.

    The error falls with the fourth power of the width.
    """
    t = np.linspace(0.0, 1.0, CHECKS)
    powers = t[:, None] ** np.arange(polynomials.shape[1])
    cubic = np.array([[comb(3, j) * x**j * (1 - x) ** (3 - j) for j in range(4)] for x in t])
    off = np.einsum("tp,spc->stc", powers, polynomials) - np.einsum(
        "tj,sjc->stc", cubic, _hermite(polynomials)
    )
    worst = np.hypot(off[..., 0], off[..., 1]).max(axis=1, initial=0.0)
    cuts: NDArray[np.int64] = np.ceil((worst / TOLERANCE_M) ** 0.25).astype(np.int64)
    cuts[cuts < 1] = 1
    return cuts


def _cut(polynomials: Polynomials, cuts: NDArray[np.int64]) -> Polynomials:
    source = np.repeat(np.arange(len(cuts)), cuts)
    number = np.arange(len(source)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    width = 1.0 / cuts[source]
    return _reparametrised(polynomials[source], number * width, width)
