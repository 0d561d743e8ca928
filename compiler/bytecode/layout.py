"""What encoder, decoder and disassembler share: the rows by number, graph classes by row, the numbers' form.

The rows themselves (``layout_rows``) are generated from runtime/bytecode.toml.

Example: ``write_u(out, 300)`` appends ``ac 02``; ``GRAPH_ROWS[graph.Enter].name`` is ``'enter'``.
"""

from __future__ import annotations

from ..graph import graph as g
from .layout_rows import NODES, OPCODES, RECORDS, SHAPES

HEADER_SIZE = 28
OPCODES_BY_ID = {row.id: row for row in OPCODES.values()}
NODES_BY_ID = {row.id: row for row in NODES.values()}
SHAPES_BY_ID = {row.id: row for row in SHAPES.values()}
RECORDS_BY_ID = {row.id: row for row in RECORDS.values()}

GRAPH_ROWS = {
    g.Empty: NODES["empty"],
    g.Symbol: NODES["symbol"],
    g.Rule: NODES["rule"],
    g.Branch: NODES["branch"],
    g.Choose: NODES["choose"],
    g.Calculate: NODES["calculate"],
    g.Transform: NODES["transform"],
    g.TransformCode: NODES["transform_code"],
    g.Texture: NODES["texture"],
    g.Union: NODES["union"],
    g.Enter: NODES["enter"],
    g.Primitive: NODES["primitive"],
    g.MeshLeaf: NODES["mesh"],
    g.Object: NODES["object"],
    g.NoShadow: NODES["no_shadow"],
}


def write_u(out: bytearray, value: int) -> None:
    """Append an unsigned LEB128 number in its shortest form."""
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
