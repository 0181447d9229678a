"""Curves drawn at random for the laws of this folder."""

import numpy as np
from hypothesis import strategies as st

from bsmap_cli.geometry.curve import Curve


@st.composite
def random_curves(draw, degree=None):
    """Any degree, any place on the lattice, from a single span on."""
    d = draw(st.integers(2, 5)) if degree is None else degree
    spans = draw(st.one_of(st.just(1), st.integers(1, 12)))
    first = draw(st.integers(-1000, 1000))
    step = draw(st.sampled_from([0.05, 0.1, 0.2, 0.3, 1.0, 4.0]))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    points = random.uniform(-3.0, 3.0, (spans + d, 2))
    return Curve(
        degree=d,
        knot_step_m=step,
        first_index=first,
        control_points=points,
        weights=np.ones(spans + d),
        tau_start_m=(first + d) * step,
        tau_end_m=(first + d + spans) * step,
    )


def inner_parameters(curve, count=40, seed=1):
    """Parameters of the whole domain: all knots, both ends, and random places."""
    u = np.random.default_rng(seed).uniform(0.0, curve.span_count, count)
    u = np.concatenate((np.arange(curve.span_count + 1.0), u))
    return (curve.first_index + curve.degree + u) * curve.knot_step_m
