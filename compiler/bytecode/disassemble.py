"""Bytecode → text, the same as ``plsys-rt --dump`` (runtime/dump.c describes it; golden cases hold both to it).

Example::

    bytecode version 1
    parameter 0 "cntTree"
    record 0 settings seed=7
    node 0 object name="Tree" ordinal=0 child=1  ; tree.plsys:12:1-12:14
    node 1 calculate name="C_init" code=@0 child=2
            0  const 10
            2  store cntTree
            4  end
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .decode import decode
from .layout import SHAPES_BY_ID
from .layout_rows import PATTERNS, RECORDS, VERSION
from .program import Instruction, Program, ProgramNode, RecordValues

TEXTURE = RECORDS["texture"]


def disassemble(data: bytes) -> str:
    """Raises BytecodeError for bytes that aren't valid bytecode."""
    program = decode(data)
    return "\n".join(_lines(program)) + "\n"


def number_text(value: float) -> str:
    """The shortest of 15, 16 or 17 significant digits that reads back as the same double; -0 as 0."""
    text = ""
    for digits in (15, 16, 17):
        text = f"{value + 0.0:.{digits}g}"
        if float(text) == value:
            break
    return text


def _lines(program: Program) -> Iterator[str]:
    yield f"bytecode version {VERSION}"
    for i, name in enumerate(program.parameters):
        yield f'parameter {i} "{program.strings[name]}"'
    for i, record in enumerate(program.records):
        yield f"record {i} {record.row.name}" + "".join(_record(record))
    for i, mesh in enumerate(program.meshes):
        counts = f"vertices={len(mesh.vertices)} normals={len(mesh.normals)} triangles={len(mesh.triangles)}"
        yield f'mesh {i} "{program.strings[mesh.name]}" {counts}'
    shown: set[int] = set()
    for i, node in enumerate(program.nodes):
        fields = (f" {name}={_field(program, type_, node.fields[name])}" for name, type_ in node.row.fields)
        yield f"node {i} {node.row.name}" + "".join(fields) + _place(program, node)
        for code in _codes(node):
            if code and code not in shown:
                shown.add(code)
                yield from (_instruction(program, here) for here in program.pieces[code - 1])


def _record(record: RecordValues) -> Iterator[str]:
    """What differs from the defaults, then the entries."""
    row = record.row
    for value in row.values.values():
        numbers = record.values[value.offset : value.offset + value.size]
        if numbers == value.default:
            continue
        if row is TEXTURE and value.name == "pattern":
            yield f" pattern={next(name for name, id in PATTERNS.items() if id == numbers[0])}"
        else:
            yield f" {value.name}={_vector(numbers)}"
    for i in range(record.entries):
        start = row.size + i * len(row.entry)
        yield f" entry={_vector(record.values[start : start + len(row.entry)])}"


def _vector(numbers: Sequence[float]) -> str:
    text = ", ".join(map(number_text, numbers))
    return f"<{text}>" if len(numbers) > 1 else text


def _field(program: Program, type_: str, value: int | list) -> str:
    match type_:
        case "nodes":
            return f"[{', '.join(map(str, value))}]"
        case "slots":
            return f"[{', '.join(_parameter(program, slot) for slot in value)}]"
        case "cases":
            return f"[{', '.join(f'{_code(weight)}: {body}' for weight, body in value)}]"
        case "code":
            return _code(value)
        case "string":
            return f'"{program.strings[value]}"'
        case "shape":
            return SHAPES_BY_ID[value].name
        case "matrix":
            return _vector(value)
    return str(value)


def _code(field: int) -> str:
    return f"@{field - 1}" if field else "none"


def _codes(node: ProgramNode) -> Iterator[int]:
    for name, type_ in node.row.fields:
        if type_ == "code":
            yield node.fields[name]
        elif type_ == "cases":
            yield from (weight for weight, _ in node.fields[name])


def _place(program: Program, node: ProgramNode) -> str:
    place = node.place
    if place is None:
        return ""
    end = f"{place.end_line}:{place.end_column}"
    return f"  ; {program.strings[place.file]}:{place.line}:{place.column}-{end}"


def _instruction(program: Program, here: Instruction) -> str:
    return f"{here.offset:9}  {here.row.name}{_operand(program, here)}"


def _operand(program: Program, here: Instruction) -> str:
    operand = here.operand
    match here.row.operand:
        case "":
            return ""
        case "slot":
            return f" {_parameter(program, operand)}"
        case "constant":
            return f" {number_text(program.constants[operand])}"
        case "string":
            return f' "{program.strings[operand]}"'
        case "offset":
            return f" {here.next + operand}"
    return _texture_value(operand) if here.row.name == "texture_set" else f" {operand}"


def _texture_value(index: int) -> str:
    """`` diffuse``, `` ambient[1]`` or `` entry[0].red``"""
    if index >= TEXTURE.size:
        entry, k = divmod(index - TEXTURE.size, len(TEXTURE.entry))
        return f" entry[{entry}].{TEXTURE.entry[k]}"
    value = next(v for v in TEXTURE.values.values() if v.offset <= index < v.offset + v.size)
    return f" {value.name}" + (f"[{index - value.offset}]" if value.size > 1 else "")


def _parameter(program: Program, slot: int) -> str:
    return program.strings[program.parameters[slot]]
