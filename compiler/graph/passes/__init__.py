"""Passes: graph → graph, each leaving out something that the scene doesn't need (``Graph.left_out`` says what).

``run_passes(graph)`` runs them in order and verifies after each, unless told not to. A pass changes the graph in place; it may change
the bits of a transformation, but never what is derived, nor a random number.
"""

from __future__ import annotations

from collections.abc import Callable

from ..graph import Graph
from ..verify import verify
from .dead import dead_parameters
from .fold import fold
from .identity import identity
from .inline import inline
from .liveness import liveness
from .merge import merge
from .prune import prune
from .singular import singular
from .textures import unused_textures

# In the order in which they help each other: constants first, then what they make superfluous, then neighbours
# that come together, and last the numbers and the facts that the runtime needs.
PASSES: tuple[Callable[[Graph], None], ...] = (
    fold,
    singular,
    dead_parameters,
    unused_textures,
    identity,
    inline,
    merge,
    prune,
    liveness,
)


def run_passes(graph: Graph, is_verified: bool = True) -> Graph:
    """The same graph, after all passes. Raises verify.InvalidGraph, naming the pass, if one of them is wrong and
    ``is_verified``."""
    if is_verified:
        verify(graph, "lower")
    for apply_pass in PASSES:
        apply_pass(graph)
        if is_verified:
            verify(graph, apply_pass.__name__)
    return graph
