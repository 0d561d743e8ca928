"""The bytecode's sections, nodes, opcodes, shapes and records as plain rows by name, in the order of ids.

Generated from runtime/bytecode.toml by runtime/generate.py, which documents every row: don't edit.

Example: ``OPCODES["pow"]`` is ``Opcode("pow", 39, "", 2, 1, "function.pow")``.
"""

from __future__ import annotations

from typing import NamedTuple


class NodeRow(NamedTuple):
    name: str
    id: int
    letter: str  # in pictures of the graph
    fields: tuple[tuple[str, str], ...]  # (name, type) in file order


class Opcode(NamedTuple):
    name: str
    id: int
    operand: str  # '' u slot constant string offset
    pops: int  # -1: as many as the operand says
    pushes: int
    row: str  # of grammar/vocabulary.toml, or ''


class ShapeRow(NamedTuple):
    name: str
    id: int
    arguments: tuple[str, ...]
    unbounded: bool
    row: str


class Value(NamedTuple):
    name: str
    offset: int  # of its first number in the record
    size: int  # numbers
    default: tuple[float, ...]


class RecordRow(NamedTuple):
    name: str
    id: int
    size: int  # numbers without entries
    values: dict[str, Value]
    entry: tuple[str, ...]  # names of an entry's numbers (defaults are 0), or ()

VERSION = 1
MAGIC = b"PLSB"
SENTINEL_FLOAT = 1.25
SENTINEL_INTEGER = 0x01020304

SECTIONS = {
    "strings": 1,
    "constants": 2,
    "parameters": 3,
    "code": 4,
    "records": 5,
    "meshes": 6,
    "nodes": 7,
    "sourcemap": 8,
}

NODES = {
    "empty": NodeRow("empty", 0, "", ()),
    "symbol": NodeRow("symbol", 1, "S", (("name", "string"), ("live", "slots"), ("draws", "u"), ("body", "node"))),
    "rule": NodeRow("rule", 2, "", (("index", "u"), ("body", "node"))),
    "branch": NodeRow("branch", 3, "", (("test", "code"), ("then", "node"), ("otherwise", "node"))),
    "choose": NodeRow("choose", 4, "", (("cases", "cases"),)),
    "calculate": NodeRow("calculate", 5, "C", (("name", "string"), ("code", "code"), ("child", "node"))),
    "transform": NodeRow("transform", 6, "T", (("name", "string"), ("matrix", "matrix"), ("child", "node"))),
    "transform_code": NodeRow("transform_code", 7, "T", (("name", "string"), ("code", "code"), ("child", "node"))),
    "texture": NodeRow("texture", 8, "X", (("name", "string"), ("texture", "record"), ("code", "code"), ("draws", "u"), ("child", "node"))),
    "union": NodeRow("union", 9, "+", (("children", "nodes"),)),
    "enter": NodeRow("enter", 10, "", (("symbol", "node"),)),
    "primitive": NodeRow("primitive", 11, "P", (("shape", "shape"), ("code", "code"))),
    "mesh": NodeRow("mesh", 12, "P", (("mesh", "mesh"),)),
    "object": NodeRow("object", 13, "", (("name", "string"), ("ordinal", "u"), ("child", "node"))),
    "no_shadow": NodeRow("no_shadow", 14, "", (("child", "node"),)),
}

OPCODES = {
    "end": Opcode("end", 0, "", 0, 0, ""),
    "const": Opcode("const", 1, "constant", 0, 1, ""),
    "load": Opcode("load", 2, "slot", 0, 1, ""),
    "store": Opcode("store", 3, "slot", 1, 0, ""),
    "jump": Opcode("jump", 4, "offset", 0, 0, ""),
    "jump_if_zero": Opcode("jump_if_zero", 5, "offset", 1, 0, ""),
    "bool": Opcode("bool", 6, "", 1, 1, ""),
    "add": Opcode("add", 10, "", 2, 1, ""),
    "subtract": Opcode("subtract", 11, "", 2, 1, ""),
    "multiply": Opcode("multiply", 12, "", 2, 1, ""),
    "divide": Opcode("divide", 13, "", 2, 1, ""),
    "modulo": Opcode("modulo", 14, "", 2, 1, ""),
    "negate": Opcode("negate", 15, "", 1, 1, ""),
    "not": Opcode("not", 16, "", 1, 1, ""),
    "less": Opcode("less", 17, "", 2, 1, ""),
    "less_equal": Opcode("less_equal", 18, "", 2, 1, ""),
    "greater": Opcode("greater", 19, "", 2, 1, ""),
    "greater_equal": Opcode("greater_equal", 20, "", 2, 1, ""),
    "equal": Opcode("equal", 21, "", 2, 1, ""),
    "not_equal": Opcode("not_equal", 22, "", 2, 1, ""),
    "abs": Opcode("abs", 30, "", 1, 1, "function.abs"),
    "sign": Opcode("sign", 31, "", 1, 1, "function.sign"),
    "floor": Opcode("floor", 32, "", 1, 1, "function.floor"),
    "ceil": Opcode("ceil", 33, "", 1, 1, "function.ceil"),
    "round": Opcode("round", 34, "", 1, 1, "function.round"),
    "min": Opcode("min", 35, "", 2, 1, "function.min"),
    "max": Opcode("max", 36, "", 2, 1, "function.max"),
    "clamp": Opcode("clamp", 37, "", 3, 1, "function.clamp"),
    "mix": Opcode("mix", 38, "", 3, 1, "function.mix"),
    "pow": Opcode("pow", 39, "", 2, 1, "function.pow"),
    "exp": Opcode("exp", 40, "", 1, 1, "function.exp"),
    "log": Opcode("log", 41, "", 1, 1, "function.log"),
    "sqrt": Opcode("sqrt", 42, "", 1, 1, "function.sqrt"),
    "sin": Opcode("sin", 43, "", 1, 1, "function.sin"),
    "cos": Opcode("cos", 44, "", 1, 1, "function.cos"),
    "tan": Opcode("tan", 45, "", 1, 1, "function.tan"),
    "asin": Opcode("asin", 46, "", 1, 1, "function.asin"),
    "acos": Opcode("acos", 47, "", 1, 1, "function.acos"),
    "atan2": Opcode("atan2", 48, "", 2, 1, "function.atan2"),
    "rand": Opcode("rand", 50, "", 1, 1, "function.rand"),
    "hash": Opcode("hash", 51, "u", -1, 1, "function.hash"),
    "variants": Opcode("variants", 52, "string", 1, 0, "operation.variants"),
    "trans": Opcode("trans", 60, "", 3, 0, "operation.trans"),
    "rotx": Opcode("rotx", 61, "", 1, 0, "operation.rotx"),
    "roty": Opcode("roty", 62, "", 1, 0, "operation.roty"),
    "rotz": Opcode("rotz", 63, "", 1, 0, "operation.rotz"),
    "rot": Opcode("rot", 64, "", 4, 0, "operation.rot"),
    "scale": Opcode("scale", 65, "", 3, 0, "operation.scale"),
    "scale_uniform": Opcode("scale_uniform", 66, "", 1, 0, "operation.scale"),
    "shear": Opcode("shear", 67, "", 6, 0, "operation.shear"),
    "matrix": Opcode("matrix", 68, "", 12, 0, "operation.matrix"),
    "texture_set": Opcode("texture_set", 70, "u", 1, 0, ""),
}

SHAPES = {
    "sphere": ShapeRow("sphere", 1, (), False, "primitive.sphere"),
    "cylinder": ShapeRow("cylinder", 2, (), False, "primitive.cylinder"),
    "cone": ShapeRow("cone", 3, ("top_radius",), False, "primitive.cone"),
    "box": ShapeRow("box", 4, (), False, "primitive.box"),
    "torus": ShapeRow("torus", 5, ("minor_radius",), False, "primitive.torus"),
    "triangle": ShapeRow("triangle", 6, (), False, "primitive.triangle"),
    "square": ShapeRow("square", 7, (), False, "primitive.square"),
    "disc": ShapeRow("disc", 8, (), False, "primitive.disc"),
    "plane": ShapeRow("plane", 9, (), True, "block.plane"),
}

PATTERNS = {
    "solid": 0,
    "checker": 1,
    "gradient": 2,
}

RECORDS = {
    "settings": RecordRow(
        "settings",
        1,
        9,
        {
            "max_trace_level": Value("max_trace_level", 0, 1, (5.0,)),
            "adc_bailout": Value("adc_bailout", 1, 1, (0.00392156862745098,)),
            "ambient_light": Value("ambient_light", 2, 3, (1.0, 1.0, 1.0)),
            "seed": Value("seed", 5, 1, (0.0,)),
            "background": Value("background", 6, 3, (0.0, 0.0, 0.0)),
        },
        (),
    ),
    "camera": RecordRow(
        "camera",
        2,
        20,
        {
            "location": Value("location", 0, 3, (0.0, 0.0, 0.0)),
            "direction": Value("direction", 3, 3, (0.0, 0.0, 1.0)),
            "right": Value("right", 6, 3, (1.3333333333333333, 0.0, 0.0)),
            "up": Value("up", 9, 3, (0.0, 1.0, 0.0)),
            "sky": Value("sky", 12, 3, (0.0, 1.0, 0.0)),
            "look_at": Value("look_at", 15, 3, (0.0, 0.0, 1.0)),
            "has_look_at": Value("has_look_at", 18, 1, (0.0,)),
            "angle": Value("angle", 19, 1, (0.0,)),
        },
        (),
    ),
    "light": RecordRow(
        "light",
        3,
        17,
        {
            "location": Value("location", 0, 3, (0.0, 0.0, 0.0)),
            "color": Value("color", 3, 3, (1.0, 1.0, 1.0)),
            "parallel": Value("parallel", 6, 1, (0.0,)),
            "spotlight": Value("spotlight", 7, 1, (0.0,)),
            "shadowless": Value("shadowless", 8, 1, (0.0,)),
            "point_at": Value("point_at", 9, 3, (0.0, 0.0, 1.0)),
            "radius": Value("radius", 12, 1, (30.0,)),
            "falloff": Value("falloff", 13, 1, (45.0,)),
            "tightness": Value("tightness", 14, 1, (0.0,)),
            "fade_distance": Value("fade_distance", 15, 1, (0.0,)),
            "fade_power": Value("fade_power", 16, 1, (0.0,)),
        },
        (),
    ),
    "texture": RecordRow(
        "texture",
        4,
        31,
        {
            "pattern": Value("pattern", 0, 1, (0.0,)),
            "direction": Value("direction", 1, 3, (1.0, 0.0, 0.0)),
            "matrix": Value("matrix", 4, 12, (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)),
            "ambient": Value("ambient", 16, 3, (0.1, 0.1, 0.1)),
            "emission": Value("emission", 19, 3, (0.0, 0.0, 0.0)),
            "diffuse": Value("diffuse", 22, 1, (0.6,)),
            "brilliance": Value("brilliance", 23, 1, (1.0,)),
            "phong": Value("phong", 24, 1, (0.0,)),
            "phong_size": Value("phong_size", 25, 1, (40.0,)),
            "specular": Value("specular", 26, 1, (0.0,)),
            "roughness": Value("roughness", 27, 1, (0.05,)),
            "reflection": Value("reflection", 28, 3, (0.0, 0.0, 0.0)),
        },
        ("position", "red", "green", "blue", "filter", "transmit"),
    ),
}

RANDOM = {
    "finalize_1": 0xBF58476D1CE4E5B9,
    "finalize_2": 0x94D049BB133111EB,
    "mix_add_x": 0x9E3779B97F4A7C15,
    "mix_mul_k": 0xD1342543DE82EF95,
    "mix_add_k": 0x632BE59BD9B4E019,
    "term": 0x7465726D00000000,
    "choice_stream": 0xFFF8000000000001,
}

LIMITS = {
    "stack": 64,
    "depth": 262144,
    "draws_per_application": 64,
    "hash_arguments": 16,
    "bytes": 1073741824,
    "nodes": 16777216,
    "record_numbers": 16777216,
}
