"""The unfolder: a cyclic graph → the primitives of its derivation, level by level, in batches.

It proves the runtime's derivation and feeds the exports; it shares nothing with the runtime but the
elementary functions. One step derives every pending symbol instance of a chunk at once: instances at the same
node are one set of NumPy arrays. A chunk is kept in derivation order (lexicographic in the union terms'
indices), so the i-th primitive here is the runtime's primitive i. Chunks that grow too wide are cut, and the
rest waits on a stack: memory is proportional to depth × chunk, not to the scene.

Example::

    unfolding = unfold(graph)
    for batch in unfolding:
        batch.kind, batch.matrix          # (n,) shape ids, (n, 3, 4) object to world
    unfolding.primitives                  # 2049 for tree.plsys
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Iterator

import numpy as np

from .. import elementary
from ..bytecode.layout_rows import OPCODES, SHAPES
from ..graph import graph as g
from ..reading.diagnostics import PlsysError
from . import matrices, textures
from .evaluate import Scope, draw, evaluate, execute, place

SHAPE_NAMES = {0: "mesh"} | {row.id: row.name for row in SHAPES.values()}


@dataclass(slots=True)
class Instances:
    """n places in the derivation; every field has n rows. ``kind`` is a shape id, 0 for a mesh, or -1 - node
    for a symbol yet to be entered; ``argument`` the shape's argument or the mesh's index; ``texture`` a
    texture node (-1: none); ``frame`` and ``values`` have no columns unless a texture of the graph needs
    them."""

    parent: np.ndarray  # (n,) int64: which instance of the last step this one comes from
    kind: np.ndarray  # (n,) int32
    argument: np.ndarray  # (n,) float64
    parameters: np.ndarray  # (n, slots) float64, NaN: not assigned
    key: np.ndarray  # (n,) uint64
    draws: np.ndarray  # (n, d) uint64
    matrix: np.ndarray  # (n, 3, 4) float64
    texture: np.ndarray  # (n,) int32
    frame: np.ndarray  # (n, 3, 4) or (n, 0, 4) float64
    values: np.ndarray  # (n, width) or (n, 0) float64
    no_shadow: np.ndarray  # (n,) bool
    symbol: np.ndarray  # (n,) int32: the innermost symbol's node, -1: none
    rule: np.ndarray  # (n,) int32
    depth: np.ndarray  # (n,) int32: symbols entered
    path: np.ndarray  # (n,) object: tuples of union term indices; empty tuples unless asked for

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def kinds(self) -> list[str]:
        """The shapes' names."""
        return [SHAPE_NAMES[kind] for kind in self.kind.tolist()]

    def take(self, rows) -> Instances:
        return Instances(*(getattr(self, f.name)[rows] for f in fields(self)))

    def but(self, **changes) -> Instances:
        return Instances(*(changes.get(f.name, getattr(self, f.name)) for f in fields(self)))


def concatenate(parts: list[Instances]) -> Instances:
    return Instances(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Instances)))


def unfold(
    graph: g.Graph,
    *,
    chunk: int = 16384,
    max_primitives: int = 10**9,
    max_depth: int = 100_000,
    max_pending: int = 4_000_000,
    paths: bool = False,
) -> Unfolding:
    """The unfolding of ``graph``, to be iterated once. ``chunk`` is the breadth of a step. The three limits
    end endless or oversized derivations with a PlsysError that names them; ``paths`` keeps each primitive's
    path."""
    return Unfolding(graph, chunk, max_primitives, max_depth, max_pending, paths)


class Unfolding:
    """An iterator over batches of finished :class:`Instances` in derivation order. ``primitives``, ``depth``
    (most symbols entered), ``singular`` (subtrees dropped because a transformation was singular) and
    ``widest`` (most instances held at once) count what has been derived so far."""

    def __init__(self, graph, chunk, max_primitives, max_depth, max_pending, paths) -> None:
        self.graph, self.chunk, self.paths = graph, chunk, paths
        self.max_primitives, self.max_depth, self.max_pending = max_primitives, max_depth, max_pending
        self.primitives = self.depth = self.singular = self.widest = 0
        self.slots = {name: i for i, name in enumerate(graph.parameters)}
        seeds = [v[0] for name, v in (graph.settings.values if graph.settings else ()) if name == "seed"]
        self.seed_key = np.uint64(elementary.seed_key(seeds[0] if seeds else 0.0))
        found = [graph.nodes[i] for i in graph.reachable()] if graph.nodes else []
        painted = [node.texture for node in found if isinstance(node, g.Texture)]
        self.has_frames = any(textures.has_frame(t) for t in painted)
        varied = not all(textures.is_constant(t) for t in painted)
        self.width = max(map(textures.row_length, painted), default=0) if varied else 0

    def __iter__(self) -> Iterator[Instances]:
        waiting: list[Instances] = []
        size = 0
        for part in self._finished():
            self.primitives += len(part)
            if self.primitives > self.max_primitives:
                raise PlsysError(
                    f"the scene unfolds into more than {self.max_primitives} primitives (max_primitives)"
                )
            waiting.append(part)
            size += len(part)
            if size >= self.chunk:
                yield concatenate(waiting)
                waiting, size = [], 0
        if waiting:
            yield concatenate(waiting)

    def _finished(self) -> Iterator[Instances]:
        """Runs of primitives in derivation order. The stack holds what comes later, the next chunk on top."""
        if not self.graph.nodes:
            return
        stack = [_Derivation(self).run(0, self._root())]
        while stack:
            self._check_size(stack)
            top = stack.pop()
            pending = np.flatnonzero(top.kind < 0)
            if len(pending) == 0:
                if len(top):
                    yield top
                continue
            first, last = pending[0], min(pending[-1] + 1, pending[0] + self.chunk)
            if first:
                yield top.take(np.arange(first))
            if last < len(top):
                stack.append(top.take(np.arange(last, len(top))))
            stack.append(_Derivation(self).step(top.take(np.arange(first, last))))

    def _check_size(self, stack: list[Instances]) -> None:
        self.depth = max(self.depth, int(stack[-1].depth.max(initial=0)))
        if self.depth > self.max_depth:
            raise PlsysError(
                f"the derivation enters more than {self.max_depth} symbols on one path (max_depth)"
            )
        held = sum(map(len, stack))
        self.widest = max(self.widest, held)
        if held > self.max_pending:
            raise PlsysError(
                f"the derivation is too wide or endless: more than {self.max_pending} instances wait "
                "(max_pending)"
            )

    def _root(self) -> Instances:
        path = np.empty(1, dtype=object)
        path[0] = ()
        return Instances(
            parent=np.zeros(1, np.int64),
            kind=np.zeros(1, np.int32),
            argument=np.zeros(1),
            parameters=np.full((1, len(self.slots)), np.nan),
            key=np.full(1, self.seed_key, np.uint64),
            draws=np.zeros((1, 0), np.uint64),
            matrix=matrices.identity(1),
            texture=np.full(1, -1, np.int32),
            frame=matrices.identity(1)[:, : 3 if self.has_frames else 0],
            values=np.full((1, self.width), np.nan),
            no_shadow=np.zeros(1, bool),
            symbol=np.full(1, -1, np.int32),
            rule=np.full(1, -1, np.int32),
            depth=np.zeros(1, np.int32),
            path=path,
        )


class _Derivation:
    """One step: ``emitted`` collects primitives and symbol references. For any one parent they come in
    derivation order, because unions are walked term by term; a stable sort by parent then orders them all."""

    def __init__(self, unfolding: Unfolding) -> None:
        self.unfolding, self.nodes = unfolding, unfolding.graph.nodes
        self.emitted: list[Instances] = []

    def run(self, node: int, instances: Instances) -> Instances:
        self._walk(node, instances)
        return self._ordered(instances)

    def step(self, chunk: Instances) -> Instances:
        """Enter every pending symbol of ``chunk`` once."""
        chunk = chunk.but(parent=np.arange(len(chunk)), draws=np.zeros((len(chunk), 0), np.uint64))
        done = chunk.kind >= 0
        if done.any():
            self.emitted.append(chunk.take(done))
        for kind in np.unique(chunk.kind[~done]):
            node, here = -1 - int(kind), chunk.take(chunk.kind == kind)
            key = elementary.mix(here.key, elementary.name_hash(self.nodes[node].name))
            symbol = np.full(len(here), node, np.int32)
            self._walk(
                self.nodes[node].body, here.but(key=key, symbol=symbol, depth=here.depth + np.int32(1))
            )
        return self._ordered(chunk)

    def _ordered(self, like: Instances) -> Instances:
        if not self.emitted:
            return like.take(slice(0, 0))
        everything = concatenate(self.emitted)
        return everything.take(np.argsort(everything.parent, kind="stable"))

    def _emit(self, kind: int, instances: Instances, argument: np.ndarray | float = 0.0) -> None:
        n = len(instances)
        self.emitted.append(
            instances.but(
                kind=np.full(n, kind, np.int32),
                argument=np.broadcast_to(np.asarray(argument, np.float64), n),
                draws=np.zeros((n, 0), np.uint64),
            )
        )

    def _scope(self, instances: Instances) -> Scope:
        unfolding = self.unfolding
        return Scope(
            instances.parameters, instances.key, instances.draws, unfolding.slots, unfolding.seed_key
        )

    def _walk(self, index: int, at: Instances) -> None:
        """Derives ``at`` from node ``index`` on, down to primitives and symbol references. Long prefixes
        are a loop, so that only nested unions and guards deepen Python's stack."""
        while len(at):
            node = self.nodes[index]
            match node:
                case g.Primitive():
                    scope = self._scope(at)
                    arguments = [evaluate(a, scope) for a in node.arguments]
                    if any(not np.isfinite(a).all() for a in arguments):
                        raise PlsysError(f"an argument of {node.shape} is not a finite number", place(node))
                    self._emit(SHAPES[node.shape].id, at, arguments[0] if arguments else 0.0)
                    return
                case g.MeshLeaf():
                    return self._emit(0, at, float(node.mesh))
                case g.Enter():
                    return self._emit(-1 - node.symbol, at)
                case g.Empty():
                    return
                case g.Union():
                    for term, child in enumerate(node.children_):
                        self._walk(child, self._term(at, term))
                    return
                case g.Branch():
                    scope = self._scope(at)
                    test = evaluate(node.test, scope)
                    if not np.isfinite(test).all():
                        raise PlsysError(
                            "a condition is not a finite number", place(node.test) or place(node)
                        )
                    taken = test != 0
                    at = at.but(draws=scope.draws)
                    self._walk(node.then, at.take(taken))
                    index, at = node.otherwise, at.take(~taken)
                case g.Choose():
                    return self._choose(node, at)
                case _:
                    index, at = (
                        node.child if not isinstance(node, g.Rule) else node.body,
                        self._operate(index, node, at),
                    )

    def _operate(self, index: int, node: g.Node, at: Instances) -> Instances:
        """What a node with one child changes for it."""
        match node:
            case g.Rule():
                return at.but(rule=np.full(len(at), node.index, np.int32))
            case g.Calculate():
                scope = self._scope(at)
                execute(node.statements, node.together, node.name, scope)
                return at.but(parameters=scope.parameters, key=scope.key, draws=scope.draws)
            case g.Transform() | g.TransformCode():
                return self._transform(node, at)
            case g.Texture():
                return self._paint(index, node, at)
            case g.NoShadow():
                return at.but(no_shadow=np.ones(len(at), bool))
            case g.Object():
                key = elementary.mix(self.unfolding.seed_key, elementary.name_hash(node.name))
                key = elementary.mix(key, np.uint64(node.ordinal))
                return at.but(
                    key=np.full(len(at), key, np.uint64),
                    parameters=np.full_like(at.parameters, np.nan),
                    draws=np.zeros((len(at), 0), np.uint64),
                )
        raise TypeError(f"node {index} is no operator: {node!r}")

    def _term(self, at: Instances, term: int) -> Instances:
        at = at.but(key=elementary.mix(at.key, np.uint64(elementary.TERM + term)))
        if self.unfolding.paths:
            path = np.empty(len(at), dtype=object)
            path[:] = [p + (term,) for p in at.path]
            at = at.but(path=path)
        return at

    def _choose(self, node: g.Choose, at: Instances) -> None:
        scope, running, sums = self._scope(at), np.zeros(len(at)), []
        for weight, _ in node.cases:
            value = evaluate(weight, scope)
            right = np.isfinite(value) & (value >= 0)
            if not right.all():
                bad = int(np.argmin(right))
                raise PlsysError(
                    f"a weight is {value[bad]:.17g}: negative or not a finite number" + scope.known(bad),
                    place(weight) or place(node),
                )
            running = running + value
            sums.append(running)
        if not (running > 0).all():
            bad = int(np.argmin(running > 0))
            raise PlsysError("all weights are 0" + scope.known(bad), place(node))
        stream = np.full(len(at), elementary.CHOICE_STREAM, np.uint64)
        threshold = draw(scope, np.arange(len(at)), stream, node) * running
        chosen = np.argmax(np.stack(sums) > threshold, axis=0)
        at = at.but(draws=scope.draws)
        for case, (_, body) in enumerate(node.cases):
            self._walk(body, at.take(chosen == case))

    def _transform(self, node: g.Transform | g.TransformCode, at: Instances) -> Instances:
        if isinstance(node, g.Transform):
            local = np.asarray(node.matrix, np.float64).reshape(1, 3, 4)
        else:
            scope, local = self._scope(at), matrices.identity(len(at))
            for step in node.steps:
                arguments = [evaluate(a, scope) for a in step.arguments]
                local = matrices.chain(local, matrices.STEPS[step.operation](*arguments))
                finite = np.isfinite(local).all(axis=(1, 2))
                if not finite.all():
                    numbers = " ".join(f"{a[np.argmin(finite)]:.17g}" for a in arguments)
                    raise PlsysError(
                        f"{_spelled(step.operation)} {numbers} gives a matrix that is not finite"
                        + scope.known(int(np.argmin(finite))),
                        place(step) or place(node),
                    )
            at = at.but(draws=scope.draws)
        singular = np.broadcast_to(matrices.is_singular(local), len(at))
        at = at.but(matrix=matrices.chain(at.matrix, local))
        if singular.any():
            self.unfolding.singular += int(singular.sum())
            at = at.take(~singular)
        return at

    def _paint(self, index: int, node: g.Texture, at: Instances) -> Instances:
        changes = {"texture": np.full(len(at), index, np.int32)}
        if self.unfolding.has_frames:
            changes["frame"] = at.matrix
        if self.unfolding.width:
            scope = self._scope(at)
            changes["values"] = textures.rows(node.texture, scope, self.unfolding.width)
            changes["draws"] = scope.draws
        return at.but(**changes)


def _spelled(operation: str) -> str:
    """An operation as it stands in the text: the bytecode has more than one for ``scale``."""
    return OPCODES[operation].row.removeprefix("operation.")
