"""What must hold between the parts of decoded bytecode, as the runtime's loader demands (runtime/verify.c).

Code keeps its stack effect on every path and ends; a node's code does what such a node's code may; every cycle of
nodes goes through an enter node, to a symbol; an application draws at most as often as the format allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from .layout import OPCODES_BY_ID, SHAPES_BY_ID
from .layout_rows import LIMITS, PATTERNS, RECORDS
from .program import Instruction, Program, ProgramNode
from .reader import BytecodeError, Reader

TEXTURE = RECORDS["texture"]
COLOURS = {PATTERNS["solid"]: 1, PATTERNS["checker"]: 2}  # entries; a gradient has one or more


@dataclass
class Piece:
    """What a piece of code does."""

    length: int = 0
    results: int = 0
    draws: int = 0
    assigns: bool = False
    transforms: bool = False
    paints: bool = False
    sets_positions: bool = False
    highest_value: int = -1  # of texture_set


def verify(program: Program) -> None:
    """Fills ``program.pieces``. Raises BytecodeError."""
    pieces: dict[int, Piece] = {}
    at = 0
    while at < len(program.code):
        pieces[at] = _verify_piece(program, at)
        at += pieces[at].length
    _verify_records(program)
    own_draws = [_verify_node(program, i, node, pieces) for i, node in enumerate(program.nodes)]
    _verify_cycles(program, own_draws)
    _verify_top(program)


def _bad_code(offset: int, reason: str) -> BytecodeError:
    return BytecodeError(f"byte {offset}: {reason}", "code")


def _bad_node(i: int, node: ProgramNode, reason: str) -> BytecodeError:
    return BytecodeError(f"node {i} ({node.row.name}): {reason}", "nodes")


# --- code


def _instruction(program: Program, at: int) -> Instruction:
    row = OPCODES_BY_ID.get(program.code[at])
    if row is None:
        raise _bad_code(at, f"there is no opcode {program.code[at]}")
    r = Reader(program.code, at + 1, len(program.code), "code")
    sizes = {"slot": program.parameters, "constant": program.constants, "string": program.strings}
    operand = None
    if row.operand in sizes:
        operand = r.index(len(sizes[row.operand]), "parameter" if row.operand == "slot" else row.operand)
    elif row.operand:
        operand = r.u()
    return Instruction(at, row, operand, r.at)


def _verify_piece(program: Program, start: int) -> Piece:
    """Follow every path at once: jumps only go forward, so that one pass sees all of them."""
    piece = Piece()
    reached = {start: (0, 0)}  # offset → depth of the stack, most draws before it
    instructions = program.pieces[start] = []
    at = start
    while True:
        here = _instruction(program, at)
        instructions.append(here)
        if at not in reached:
            raise _bad_code(at, f"{here.row.name} can't be reached")
        depth, draws = reached.pop(at)
        if reached and min(reached) < here.next:
            raise _bad_code(min(reached), f"a jump leads into the middle of {here.row.name}")
        draws += here.row.name == "rand"
        _note(here, piece)
        pops = here.operand if here.row.pops < 0 else here.row.pops
        if depth < pops:
            raise _bad_code(at, f"{here.row.name} takes {pops} values, the stack has {depth}")
        depth += here.row.pushes - pops
        if depth > LIMITS["stack"]:
            raise _bad_code(at, f"more than {LIMITS['stack']} values on the stack")
        if here.row.name == "end":
            if reached:
                raise _bad_code(at, f"end stands before the byte {max(reached)} that is jumped to")
            piece.length, piece.results, piece.draws = here.next - start, depth, draws
            return piece
        if here.next >= len(program.code):
            raise _bad_code(at, f"no end follows {here.row.name}")
        for target in _targets(here, len(program.code)):
            before = reached.get(target, (depth, 0))
            if before[0] != depth:
                reason = (
                    f"leads to byte {target} with {depth} values on the stack, another path with {before[0]}"
                )
                raise _bad_code(at, reason)
            reached[target] = (depth, max(draws, before[1]))
        at = here.next


def _targets(here: Instruction, length: int) -> list[int]:
    targets = [] if here.row.name == "jump" else [here.next]
    if here.row.operand == "offset":
        if here.operand >= length - here.next:
            raise _bad_code(here.offset, f"{here.row.name} leaves the code")
        targets.append(here.next + here.operand)
    return targets


def _note(here: Instruction, piece: Piece) -> None:
    match here.row.name:
        case "store" | "variants":
            piece.assigns = True
        case "texture_set":
            piece.paints = True
            piece.sets_positions |= here.operand >= TEXTURE.size
            piece.highest_value = max(piece.highest_value, here.operand)
            if here.operand == TEXTURE.values["pattern"].offset:
                raise _bad_code(here.offset, "texture_set changes the pattern")
        case "hash" if not 1 <= here.operand <= LIMITS["hash_arguments"]:
            reason = f"hash of {here.operand} arguments, not 1 to {LIMITS['hash_arguments']}"
            raise _bad_code(here.offset, reason)
        case name:
            piece.transforms |= name in TRANSFORMATIONS


TRANSFORMATIONS = {row.name for row in OPCODES_BY_ID.values() if row.name == "matrix" or 60 <= row.id < 68}


# --- records and nodes


def _verify_records(program: Program) -> None:
    for i, record in enumerate(program.records):
        if record.row is not TEXTURE:
            continue
        pattern = record.values[TEXTURE.values["pattern"].offset]
        if pattern not in PATTERNS.values():
            raise BytecodeError(f"record {i}: there is no pattern {pattern:.17g}", "records")
        if COLOURS.get(pattern, record.entries) != record.entries or record.entries == 0:
            raise BytecodeError(f"record {i}: {record.entries} colours don't fit the pattern", "records")


def _verify_node(program: Program, i: int, node: ProgramNode, pieces: dict[int, Piece]) -> int:
    """A node's own fields; the most draws that its code makes."""

    def code(field: int, results: int = 0, does: str = "") -> Piece:
        piece = pieces.get(field - 1) if field else Piece()
        if piece is None:
            raise _bad_node(i, node, f"no code starts at byte {field - 1}")
        if piece.results != results:
            raise _bad_node(i, node, f"its code leaves {piece.results} values, not {results}")
        for name, who in (
            ("assigns", "calculation"),
            ("transforms", "transformation"),
            ("paints", "texture"),
        ):
            if getattr(piece, name) and name != does:
                raise _bad_node(i, node, f"its code does what only a {who} may")
        return piece

    fields = node.fields
    match node.row.name:
        case "symbol" if fields["draws"] > 1:
            raise _bad_node(i, node, f"draws is {fields['draws']}, not 0 or 1")
        case "rule" if fields["index"] >= LIMITS["nodes"]:
            raise _bad_node(i, node, f"its index {fields['index']} is too large")
        case "branch":
            return code(fields["test"], 1).draws
        case "choose":
            if not fields["cases"]:
                raise _bad_node(i, node, "there are no cases")
            return 1 + sum(code(weight, 1).draws for weight, _ in fields["cases"])
        case "calculate":
            return code(fields["code"], does="assigns").draws
        case "transform_code":
            return code(fields["code"], does="transforms").draws
        case "texture":
            piece = code(fields["code"], does="paints")
            _verify_texture(program, i, node, piece)
            return piece.draws
        case "union" if len(fields["children"]) < 2:
            raise _bad_node(i, node, f"{len(fields['children'])} terms, at least 2")
        case "enter" if program.nodes[fields["symbol"]].row.name != "symbol":
            raise _bad_node(i, node, f"node {fields['symbol']} is no symbol")
        case "primitive":
            shape = SHAPES_BY_ID.get(fields["shape"])
            if shape is None:
                raise _bad_node(i, node, f"there is no shape {fields['shape']}")
            return code(fields["code"], len(shape.arguments)).draws
    return 0


def _verify_texture(program: Program, i: int, node: ProgramNode, piece: Piece) -> None:
    record = program.records[node.fields["texture"]]
    if record.row is not TEXTURE:
        raise _bad_node(i, node, f"record {node.fields['texture']} is no texture")
    if piece.highest_value >= len(record.values):
        raise _bad_node(i, node, f"its code sets value {piece.highest_value} of {len(record.values)}")
    if node.fields["draws"] != (piece.draws > 0):
        raise _bad_node(i, node, f"draws is {node.fields['draws']}, but its code draws {piece.draws} times")
    is_gradient = record.values[TEXTURE.values["pattern"].offset] == PATTERNS["gradient"]
    positions = record.values[TEXTURE.size :: len(TEXTURE.entry)]
    for k, (before, after) in enumerate(pairwise(positions), 1):
        if is_gradient and not piece.sets_positions and after < before:
            raise _bad_node(i, node, f"the colour map's position {k} is below the one before it")


# --- the graph


def children_of(node: ProgramNode) -> list[int]:
    """In derivation order; an enter node's symbol is none."""
    found: list[int] = []
    for name, type_ in node.row.fields:
        if type_ == "node" and name != "symbol":
            found.append(node.fields[name])
        elif type_ == "nodes":
            found.extend(node.fields[name])
        elif type_ == "cases":
            found.extend(body for _, body in node.fields[name])
    return found


def _verify_cycles(program: Program, own_draws: list[int]) -> None:
    """No cycle without an enter node, and draws summed along the longest path of an application."""
    unseen, open_ = -2, -1
    most = [unseen] * len(program.nodes)
    for start in range(len(program.nodes)):
        stack = [start]
        while stack:
            i = stack[-1]
            node = program.nodes[i]
            children = children_of(node)
            if most[i] >= 0:
                stack.pop()
            elif most[i] == open_:
                below = [most[c] for c in children if program.nodes[c].row.name != "symbol"]
                most[i] = own_draws[i] + max(below, default=0)
                if most[i] > LIMITS["draws_per_application"]:
                    reason = f"more than {LIMITS['draws_per_application']} draws in one application"
                    raise _bad_node(i, node, reason)
                stack.pop()
            else:
                most[i] = open_
                for child in reversed(children):
                    if most[child] == open_:
                        raise _bad_node(
                            child, program.nodes[child], "it contains itself without entering a symbol"
                        )
                    if most[child] == unseen:
                        stack.append(child)


def _verify_top(program: Program) -> None:
    """Objects stand at the top and nowhere else."""
    allowed = ("empty", "object", "union")
    root = program.nodes[0]
    if root.row.name not in allowed:
        raise _bad_node(0, root, "the root is no object, nor a union of objects")
    top, stack = set(), [0] if root.row.name == "union" else []
    while stack:
        i = stack.pop()
        if i in top:
            continue
        top.add(i)
        for child in children_of(program.nodes[i]):
            if program.nodes[child].row.name not in allowed:
                raise _bad_node(child, program.nodes[child], "it stands beside objects, but is none")
            if program.nodes[child].row.name == "union":
                stack.append(child)
    for i, node in enumerate(program.nodes):
        for child in children_of(node):
            if i not in top and (program.nodes[child].row.name == "object" or child in top):
                raise _bad_node(i, node, "an object stands below it")
