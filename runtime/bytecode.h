/* bytecode.h - the bytecode's sections, nodes, opcodes, shapes and records.
 *
 * Generated from bytecode.toml by generate.py, which documents every row: don't edit. */
#ifndef PL_BYTECODE_H
#define PL_BYTECODE_H

#include <stdbool.h>
#include <stdint.h>

#define PL_VERSION 1
#define PL_MAGIC "PLSB"
#define PL_SENTINEL_FLOAT 1.25
#define PL_SENTINEL_INTEGER 0x01020304u

/* Limits. */
enum {
    PL_LIMIT_STACK = 64,
    PL_LIMIT_DEPTH = 262144,
    PL_LIMIT_DRAWS_PER_APPLICATION = 64,
    PL_LIMIT_HASH_ARGUMENTS = 16,
    PL_LIMIT_BYTES = 1073741824,
    PL_LIMIT_NODES = 16777216,
    PL_LIMIT_RECORD_NUMBERS = 16777216,
};

/* Constants of the random functions (random.h). */
#define PL_RANDOM_FINALIZE_1 UINT64_C(0xBF58476D1CE4E5B9)
#define PL_RANDOM_FINALIZE_2 UINT64_C(0x94D049BB133111EB)
#define PL_RANDOM_MIX_ADD_X UINT64_C(0x9E3779B97F4A7C15)
#define PL_RANDOM_MIX_MUL_K UINT64_C(0xD1342543DE82EF95)
#define PL_RANDOM_MIX_ADD_K UINT64_C(0x632BE59BD9B4E019)
#define PL_RANDOM_TERM UINT64_C(0x7465726D00000000)
#define PL_RANDOM_CHOICE_STREAM UINT64_C(0xFFF8000000000001)

/* Sections, in file order. */
enum pl_section_id {
    PL_SECTION_STRINGS = 1,
    PL_SECTION_CONSTANTS = 2,
    PL_SECTION_PARAMETERS = 3,
    PL_SECTION_CODE = 4,
    PL_SECTION_RECORDS = 5,
    PL_SECTION_MESHES = 6,
    PL_SECTION_NODES = 7,
    PL_SECTION_SOURCEMAP = 8,
};

/* Sections in file order: X(ENUM, name, id). */
#define PL_SECTIONS(X) \
    X(STRINGS, "strings", 1) \
    X(CONSTANTS, "constants", 2) \
    X(PARAMETERS, "parameters", 3) \
    X(CODE, "code", 4) \
    X(RECORDS, "records", 5) \
    X(MESHES, "meshes", 6) \
    X(NODES, "nodes", 7) \
    X(SOURCEMAP, "sourcemap", 8)

/* Node kinds. */
enum pl_node_id {
    PL_NODE_EMPTY = 0,
    PL_NODE_SYMBOL = 1,
    PL_NODE_RULE = 2,
    PL_NODE_BRANCH = 3,
    PL_NODE_CHOOSE = 4,
    PL_NODE_CALCULATE = 5,
    PL_NODE_TRANSFORM = 6,
    PL_NODE_TRANSFORM_CODE = 7,
    PL_NODE_TEXTURE = 8,
    PL_NODE_UNION = 9,
    PL_NODE_ENTER = 10,
    PL_NODE_PRIMITIVE = 11,
    PL_NODE_MESH = 12,
    PL_NODE_OBJECT = 13,
    PL_NODE_NO_SHADOW = 14,
};

/* Node kinds: X(ENUM, name, id, letter in pictures, first field in PL_NODE_FIELDS, fields). */
#define PL_NODES(X) \
    X(EMPTY, "empty", 0, "", 0, 0) \
    X(SYMBOL, "symbol", 1, "S", 0, 4) \
    X(RULE, "rule", 2, "", 4, 2) \
    X(BRANCH, "branch", 3, "", 6, 3) \
    X(CHOOSE, "choose", 4, "", 9, 1) \
    X(CALCULATE, "calculate", 5, "C", 10, 3) \
    X(TRANSFORM, "transform", 6, "T", 13, 3) \
    X(TRANSFORM_CODE, "transform_code", 7, "T", 16, 3) \
    X(TEXTURE, "texture", 8, "X", 19, 5) \
    X(UNION, "union", 9, "+", 24, 1) \
    X(ENTER, "enter", 10, "", 25, 1) \
    X(PRIMITIVE, "primitive", 11, "P", 26, 2) \
    X(MESH, "mesh", 12, "P", 28, 1) \
    X(OBJECT, "object", 13, "", 29, 3) \
    X(NO_SHADOW, "no_shadow", 14, "", 32, 1)

/* Types of node fields. */
enum pl_field_id {
    PL_FIELD_NODE,
    PL_FIELD_NODES,
    PL_FIELD_CODE,
    PL_FIELD_STRING,
    PL_FIELD_SLOTS,
    PL_FIELD_RECORD,
    PL_FIELD_MESH,
    PL_FIELD_SHAPE,
    PL_FIELD_U,
    PL_FIELD_MATRIX,
    PL_FIELD_CASES,
};

/* Fields of nodes in file order: X(NODE, name, type). */
#define PL_NODE_FIELDS(X) \
    X(SYMBOL, "name", PL_FIELD_STRING) \
    X(SYMBOL, "live", PL_FIELD_SLOTS) \
    X(SYMBOL, "draws", PL_FIELD_U) \
    X(SYMBOL, "body", PL_FIELD_NODE) \
    X(RULE, "index", PL_FIELD_U) \
    X(RULE, "body", PL_FIELD_NODE) \
    X(BRANCH, "test", PL_FIELD_CODE) \
    X(BRANCH, "then", PL_FIELD_NODE) \
    X(BRANCH, "otherwise", PL_FIELD_NODE) \
    X(CHOOSE, "cases", PL_FIELD_CASES) \
    X(CALCULATE, "name", PL_FIELD_STRING) \
    X(CALCULATE, "code", PL_FIELD_CODE) \
    X(CALCULATE, "child", PL_FIELD_NODE) \
    X(TRANSFORM, "name", PL_FIELD_STRING) \
    X(TRANSFORM, "matrix", PL_FIELD_MATRIX) \
    X(TRANSFORM, "child", PL_FIELD_NODE) \
    X(TRANSFORM_CODE, "name", PL_FIELD_STRING) \
    X(TRANSFORM_CODE, "code", PL_FIELD_CODE) \
    X(TRANSFORM_CODE, "child", PL_FIELD_NODE) \
    X(TEXTURE, "name", PL_FIELD_STRING) \
    X(TEXTURE, "texture", PL_FIELD_RECORD) \
    X(TEXTURE, "code", PL_FIELD_CODE) \
    X(TEXTURE, "draws", PL_FIELD_U) \
    X(TEXTURE, "child", PL_FIELD_NODE) \
    X(UNION, "children", PL_FIELD_NODES) \
    X(ENTER, "symbol", PL_FIELD_NODE) \
    X(PRIMITIVE, "shape", PL_FIELD_SHAPE) \
    X(PRIMITIVE, "code", PL_FIELD_CODE) \
    X(MESH, "mesh", PL_FIELD_MESH) \
    X(OBJECT, "name", PL_FIELD_STRING) \
    X(OBJECT, "ordinal", PL_FIELD_U) \
    X(OBJECT, "child", PL_FIELD_NODE) \
    X(NO_SHADOW, "child", PL_FIELD_NODE)

/* A node's fields in memory. A list is the index of its first element in a pool and a count.
 * `words` are the same numbers in file order; a list takes two of them, every other field one. */
enum { PL_NODE_WORDS = 5 };
typedef union pl_node_fields {
    uint32_t words[PL_NODE_WORDS];
    struct { uint32_t name, live_first, live_count, draws, body; } symbol;
    struct { uint32_t index, body; } rule;
    struct { uint32_t test, then, otherwise; } branch;
    struct { uint32_t cases_first, cases_count; } choose;
    struct { uint32_t name, code, child; } calculate;
    struct { uint32_t name, matrix, child; } transform;
    struct { uint32_t name, code, child; } transform_code;
    struct { uint32_t name, texture, code, draws, child; } texture;
    struct { uint32_t children_first, children_count; } union_;
    struct { uint32_t symbol; } enter;
    struct { uint32_t shape, code; } primitive;
    struct { uint32_t mesh; } mesh;
    struct { uint32_t name, ordinal, child; } object;
    struct { uint32_t child; } no_shadow;
} pl_node_fields;

/* Opcodes. */
enum pl_op_id {
    PL_OP_END = 0,
    PL_OP_CONST = 1,
    PL_OP_LOAD = 2,
    PL_OP_STORE = 3,
    PL_OP_JUMP = 4,
    PL_OP_JUMP_IF_ZERO = 5,
    PL_OP_BOOL = 6,
    PL_OP_ADD = 10,
    PL_OP_SUBTRACT = 11,
    PL_OP_MULTIPLY = 12,
    PL_OP_DIVIDE = 13,
    PL_OP_MODULO = 14,
    PL_OP_NEGATE = 15,
    PL_OP_NOT = 16,
    PL_OP_LESS = 17,
    PL_OP_LESS_EQUAL = 18,
    PL_OP_GREATER = 19,
    PL_OP_GREATER_EQUAL = 20,
    PL_OP_EQUAL = 21,
    PL_OP_NOT_EQUAL = 22,
    PL_OP_ABS = 30,
    PL_OP_SIGN = 31,
    PL_OP_FLOOR = 32,
    PL_OP_CEIL = 33,
    PL_OP_ROUND = 34,
    PL_OP_MIN = 35,
    PL_OP_MAX = 36,
    PL_OP_CLAMP = 37,
    PL_OP_MIX = 38,
    PL_OP_POW = 39,
    PL_OP_EXP = 40,
    PL_OP_LOG = 41,
    PL_OP_SQRT = 42,
    PL_OP_SIN = 43,
    PL_OP_COS = 44,
    PL_OP_TAN = 45,
    PL_OP_ASIN = 46,
    PL_OP_ACOS = 47,
    PL_OP_ATAN2 = 48,
    PL_OP_RAND = 50,
    PL_OP_HASH = 51,
    PL_OP_VARIANTS = 52,
    PL_OP_TRANS = 60,
    PL_OP_ROTX = 61,
    PL_OP_ROTY = 62,
    PL_OP_ROTZ = 63,
    PL_OP_ROT = 64,
    PL_OP_SCALE = 65,
    PL_OP_SCALE_UNIFORM = 66,
    PL_OP_SHEAR = 67,
    PL_OP_MATRIX = 68,
    PL_OP_TEXTURE_SET = 70,
};

/* Types of operands. */
enum pl_operand_id {
    PL_OPERAND_NONE,
    PL_OPERAND_U,
    PL_OPERAND_SLOT,
    PL_OPERAND_CONSTANT,
    PL_OPERAND_STRING,
    PL_OPERAND_OFFSET,
};

/* Opcodes: X(ENUM, name, id, operand, pops, pushes); pops is -1 where the operand says how many. */
#define PL_OPCODES(X) \
    X(END, "end", 0, PL_OPERAND_NONE, 0, 0) \
    X(CONST, "const", 1, PL_OPERAND_CONSTANT, 0, 1) \
    X(LOAD, "load", 2, PL_OPERAND_SLOT, 0, 1) \
    X(STORE, "store", 3, PL_OPERAND_SLOT, 1, 0) \
    X(JUMP, "jump", 4, PL_OPERAND_OFFSET, 0, 0) \
    X(JUMP_IF_ZERO, "jump_if_zero", 5, PL_OPERAND_OFFSET, 1, 0) \
    X(BOOL, "bool", 6, PL_OPERAND_NONE, 1, 1) \
    X(ADD, "add", 10, PL_OPERAND_NONE, 2, 1) \
    X(SUBTRACT, "subtract", 11, PL_OPERAND_NONE, 2, 1) \
    X(MULTIPLY, "multiply", 12, PL_OPERAND_NONE, 2, 1) \
    X(DIVIDE, "divide", 13, PL_OPERAND_NONE, 2, 1) \
    X(MODULO, "modulo", 14, PL_OPERAND_NONE, 2, 1) \
    X(NEGATE, "negate", 15, PL_OPERAND_NONE, 1, 1) \
    X(NOT, "not", 16, PL_OPERAND_NONE, 1, 1) \
    X(LESS, "less", 17, PL_OPERAND_NONE, 2, 1) \
    X(LESS_EQUAL, "less_equal", 18, PL_OPERAND_NONE, 2, 1) \
    X(GREATER, "greater", 19, PL_OPERAND_NONE, 2, 1) \
    X(GREATER_EQUAL, "greater_equal", 20, PL_OPERAND_NONE, 2, 1) \
    X(EQUAL, "equal", 21, PL_OPERAND_NONE, 2, 1) \
    X(NOT_EQUAL, "not_equal", 22, PL_OPERAND_NONE, 2, 1) \
    X(ABS, "abs", 30, PL_OPERAND_NONE, 1, 1) \
    X(SIGN, "sign", 31, PL_OPERAND_NONE, 1, 1) \
    X(FLOOR, "floor", 32, PL_OPERAND_NONE, 1, 1) \
    X(CEIL, "ceil", 33, PL_OPERAND_NONE, 1, 1) \
    X(ROUND, "round", 34, PL_OPERAND_NONE, 1, 1) \
    X(MIN, "min", 35, PL_OPERAND_NONE, 2, 1) \
    X(MAX, "max", 36, PL_OPERAND_NONE, 2, 1) \
    X(CLAMP, "clamp", 37, PL_OPERAND_NONE, 3, 1) \
    X(MIX, "mix", 38, PL_OPERAND_NONE, 3, 1) \
    X(POW, "pow", 39, PL_OPERAND_NONE, 2, 1) \
    X(EXP, "exp", 40, PL_OPERAND_NONE, 1, 1) \
    X(LOG, "log", 41, PL_OPERAND_NONE, 1, 1) \
    X(SQRT, "sqrt", 42, PL_OPERAND_NONE, 1, 1) \
    X(SIN, "sin", 43, PL_OPERAND_NONE, 1, 1) \
    X(COS, "cos", 44, PL_OPERAND_NONE, 1, 1) \
    X(TAN, "tan", 45, PL_OPERAND_NONE, 1, 1) \
    X(ASIN, "asin", 46, PL_OPERAND_NONE, 1, 1) \
    X(ACOS, "acos", 47, PL_OPERAND_NONE, 1, 1) \
    X(ATAN2, "atan2", 48, PL_OPERAND_NONE, 2, 1) \
    X(RAND, "rand", 50, PL_OPERAND_NONE, 1, 1) \
    X(HASH, "hash", 51, PL_OPERAND_U, -1, 1) \
    X(VARIANTS, "variants", 52, PL_OPERAND_STRING, 1, 0) \
    X(TRANS, "trans", 60, PL_OPERAND_NONE, 3, 0) \
    X(ROTX, "rotx", 61, PL_OPERAND_NONE, 1, 0) \
    X(ROTY, "roty", 62, PL_OPERAND_NONE, 1, 0) \
    X(ROTZ, "rotz", 63, PL_OPERAND_NONE, 1, 0) \
    X(ROT, "rot", 64, PL_OPERAND_NONE, 4, 0) \
    X(SCALE, "scale", 65, PL_OPERAND_NONE, 3, 0) \
    X(SCALE_UNIFORM, "scale_uniform", 66, PL_OPERAND_NONE, 1, 0) \
    X(SHEAR, "shear", 67, PL_OPERAND_NONE, 6, 0) \
    X(MATRIX, "matrix", 68, PL_OPERAND_NONE, 12, 0) \
    X(TEXTURE_SET, "texture_set", 70, PL_OPERAND_U, 1, 0)

/* Shapes. */
enum pl_shape_id {
    PL_SHAPE_SPHERE = 1,
    PL_SHAPE_CYLINDER = 2,
    PL_SHAPE_CONE = 3,
    PL_SHAPE_BOX = 4,
    PL_SHAPE_TORUS = 5,
    PL_SHAPE_TRIANGLE = 6,
    PL_SHAPE_SQUARE = 7,
    PL_SHAPE_DISC = 8,
    PL_SHAPE_PLANE = 9,
};

enum { PL_SHAPE_ARGUMENTS = 1 }; /* most that one has */

/* Shapes: X(ENUM, name, id, arguments, unbounded). */
#define PL_SHAPES(X) \
    X(SPHERE, "sphere", 1, 0, false) \
    X(CYLINDER, "cylinder", 2, 0, false) \
    X(CONE, "cone", 3, 1, false) \
    X(BOX, "box", 4, 0, false) \
    X(TORUS, "torus", 5, 1, false) \
    X(TRIANGLE, "triangle", 6, 0, false) \
    X(SQUARE, "square", 7, 0, false) \
    X(DISC, "disc", 8, 0, false) \
    X(PLANE, "plane", 9, 0, true)

/* Values of a texture's `pattern`. */
enum pl_pattern_id {
    PL_PATTERN_SOLID = 0,
    PL_PATTERN_CHECKER = 1,
    PL_PATTERN_GRADIENT = 2,
};

/* Patterns: X(ENUM, name, id). */
#define PL_PATTERNS(X) \
    X(SOLID, "solid", 0) \
    X(CHECKER, "checker", 1) \
    X(GRADIENT, "gradient", 2)

/* Record kinds. */
enum pl_record_id {
    PL_RECORD_SETTINGS = 1,
    PL_RECORD_CAMERA = 2,
    PL_RECORD_LIGHT = 3,
    PL_RECORD_TEXTURE = 4,
};

/* Offsets of the values of a settings record. */
enum {
    PL_SETTINGS_MAX_TRACE_LEVEL = 0, /* 1 */
    PL_SETTINGS_ADC_BAILOUT = 1, /* 1 */
    PL_SETTINGS_AMBIENT_LIGHT = 2, /* 3 */
    PL_SETTINGS_SEED = 5, /* 1 */
    PL_SETTINGS_BACKGROUND = 6, /* 3 */
    PL_SETTINGS_VALUES = 9,
    PL_SETTINGS_ENTRY = 0 /* numbers an entry */
};
#define PL_SETTINGS_DEFAULTS \
    { \
        5.0, \
        0.00392156862745098, \
        1.0, 1.0, 1.0, \
        0.0, \
        0.0, 0.0, 0.0, \
    }

/* Offsets of the values of a camera record. */
enum {
    PL_CAMERA_LOCATION = 0, /* 3 */
    PL_CAMERA_DIRECTION = 3, /* 3 */
    PL_CAMERA_RIGHT = 6, /* 3 */
    PL_CAMERA_UP = 9, /* 3 */
    PL_CAMERA_SKY = 12, /* 3 */
    PL_CAMERA_LOOK_AT = 15, /* 3 */
    PL_CAMERA_HAS_LOOK_AT = 18, /* 1 */
    PL_CAMERA_ANGLE = 19, /* 1 */
    PL_CAMERA_VALUES = 20,
    PL_CAMERA_ENTRY = 0 /* numbers an entry */
};
#define PL_CAMERA_DEFAULTS \
    { \
        0.0, 0.0, 0.0, \
        0.0, 0.0, 1.0, \
        1.3333333333333333, 0.0, 0.0, \
        0.0, 1.0, 0.0, \
        0.0, 1.0, 0.0, \
        0.0, 0.0, 1.0, \
        0.0, \
        0.0, \
    }

/* Offsets of the values of a light record. */
enum {
    PL_LIGHT_LOCATION = 0, /* 3 */
    PL_LIGHT_COLOR = 3, /* 3 */
    PL_LIGHT_PARALLEL = 6, /* 1 */
    PL_LIGHT_SPOTLIGHT = 7, /* 1 */
    PL_LIGHT_SHADOWLESS = 8, /* 1 */
    PL_LIGHT_POINT_AT = 9, /* 3 */
    PL_LIGHT_RADIUS = 12, /* 1 */
    PL_LIGHT_FALLOFF = 13, /* 1 */
    PL_LIGHT_TIGHTNESS = 14, /* 1 */
    PL_LIGHT_FADE_DISTANCE = 15, /* 1 */
    PL_LIGHT_FADE_POWER = 16, /* 1 */
    PL_LIGHT_VALUES = 17,
    PL_LIGHT_ENTRY = 0 /* numbers an entry */
};
#define PL_LIGHT_DEFAULTS \
    { \
        0.0, 0.0, 0.0, \
        1.0, 1.0, 1.0, \
        0.0, \
        0.0, \
        0.0, \
        0.0, 0.0, 1.0, \
        30.0, \
        45.0, \
        0.0, \
        0.0, \
        0.0, \
    }

/* Offsets of the values of a texture record. */
enum {
    PL_TEXTURE_PATTERN = 0, /* 1 */
    PL_TEXTURE_DIRECTION = 1, /* 3 */
    PL_TEXTURE_MATRIX = 4, /* 12 */
    PL_TEXTURE_AMBIENT = 16, /* 3 */
    PL_TEXTURE_EMISSION = 19, /* 3 */
    PL_TEXTURE_DIFFUSE = 22, /* 1 */
    PL_TEXTURE_BRILLIANCE = 23, /* 1 */
    PL_TEXTURE_PHONG = 24, /* 1 */
    PL_TEXTURE_PHONG_SIZE = 25, /* 1 */
    PL_TEXTURE_SPECULAR = 26, /* 1 */
    PL_TEXTURE_ROUGHNESS = 27, /* 1 */
    PL_TEXTURE_REFLECTION = 28, /* 3 */
    PL_TEXTURE_VALUES = 31,
    PL_TEXTURE_ENTRY_POSITION = 0, /* in an entry */
    PL_TEXTURE_ENTRY_RED = 1, /* in an entry */
    PL_TEXTURE_ENTRY_GREEN = 2, /* in an entry */
    PL_TEXTURE_ENTRY_BLUE = 3, /* in an entry */
    PL_TEXTURE_ENTRY_FILTER = 4, /* in an entry */
    PL_TEXTURE_ENTRY_TRANSMIT = 5, /* in an entry */
    PL_TEXTURE_ENTRY = 6 /* numbers an entry */
};
#define PL_TEXTURE_DEFAULTS \
    { \
        0.0, \
        1.0, 0.0, 0.0, \
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, \
        0.1, 0.1, 0.1, \
        0.0, 0.0, 0.0, \
        0.6, \
        1.0, \
        0.0, \
        40.0, \
        0.0, \
        0.05, \
        0.0, 0.0, 0.0, \
    }

/* Records: X(ENUM, name, numbers, numbers an entry). */
#define PL_RECORDS(X) \
    X(SETTINGS, "settings", PL_SETTINGS_VALUES, PL_SETTINGS_ENTRY) \
    X(CAMERA, "camera", PL_CAMERA_VALUES, PL_CAMERA_ENTRY) \
    X(LIGHT, "light", PL_LIGHT_VALUES, PL_LIGHT_ENTRY) \
    X(TEXTURE, "texture", PL_TEXTURE_VALUES, PL_TEXTURE_ENTRY)

/* Values of records: X(RECORD, name, offset, size). */
#define PL_RECORD_FIELDS(X) \
    X(SETTINGS, "max_trace_level", 0, 1) \
    X(SETTINGS, "adc_bailout", 1, 1) \
    X(SETTINGS, "ambient_light", 2, 3) \
    X(SETTINGS, "seed", 5, 1) \
    X(SETTINGS, "background", 6, 3) \
    X(CAMERA, "location", 0, 3) \
    X(CAMERA, "direction", 3, 3) \
    X(CAMERA, "right", 6, 3) \
    X(CAMERA, "up", 9, 3) \
    X(CAMERA, "sky", 12, 3) \
    X(CAMERA, "look_at", 15, 3) \
    X(CAMERA, "has_look_at", 18, 1) \
    X(CAMERA, "angle", 19, 1) \
    X(LIGHT, "location", 0, 3) \
    X(LIGHT, "color", 3, 3) \
    X(LIGHT, "parallel", 6, 1) \
    X(LIGHT, "spotlight", 7, 1) \
    X(LIGHT, "shadowless", 8, 1) \
    X(LIGHT, "point_at", 9, 3) \
    X(LIGHT, "radius", 12, 1) \
    X(LIGHT, "falloff", 13, 1) \
    X(LIGHT, "tightness", 14, 1) \
    X(LIGHT, "fade_distance", 15, 1) \
    X(LIGHT, "fade_power", 16, 1) \
    X(TEXTURE, "pattern", 0, 1) \
    X(TEXTURE, "direction", 1, 3) \
    X(TEXTURE, "matrix", 4, 12) \
    X(TEXTURE, "ambient", 16, 3) \
    X(TEXTURE, "emission", 19, 3) \
    X(TEXTURE, "diffuse", 22, 1) \
    X(TEXTURE, "brilliance", 23, 1) \
    X(TEXTURE, "phong", 24, 1) \
    X(TEXTURE, "phong_size", 25, 1) \
    X(TEXTURE, "specular", 26, 1) \
    X(TEXTURE, "roughness", 27, 1) \
    X(TEXTURE, "reflection", 28, 3)

/* Numbers of an entry: X(RECORD, name, offset in the entry). */
#define PL_RECORD_ENTRIES(X) \
    X(TEXTURE, "position", 0) \
    X(TEXTURE, "red", 1) \
    X(TEXTURE, "green", 2) \
    X(TEXTURE, "blue", 3) \
    X(TEXTURE, "filter", 4) \
    X(TEXTURE, "transmit", 5)

#endif
