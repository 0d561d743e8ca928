/**
 * plsys: a scene language of PL-systems and POV-Ray-style blocks.
 *
 * Text → syntax tree. Names are not keywords: `sphere`, `Tree` and `location` are all `name`, and
 * vocabulary.toml gives them meaning, so a new primitive or block needs no new parser.
 *
 *     Selection Tree { Tree -> T_scale cylinder + C_step Tree; }     a production
 *     camera { location <0, -14, 5> }                                a scene block
 *
 * Two rules keep half-typed files readable:
 *   1. Closers (`}` `)` of groups, `]`, `;`) are optional, so that a missing one never costs a neighbour.
 *   2. Common mistakes (`=>`, `=` in a condition, `elseif`, braces round a rule, a stray `;`) parse, and
 *      the reader (compiler/reading) explains them. A tree without ERROR is therefore not yet a right one.
 */

// Unary - !; * / %; + -; < <= > >=; == !=; &&; ||; ?:   ('=' stands with ==, for the reader to explain)
const PREC = { conditional: 1, or: 2, and: 3, equal: 4, compare: 5, add: 6, multiply: 7, unary: 8 };

const ARITHMETIC = [
  [PREC.multiply, '*', '/', '%'],
  [PREC.add, '+', '-'],
];

const COMPARISON = [
  [PREC.compare, '<', '<=', '>', '>='],
  [PREC.equal, '==', '!=', '='],
  [PREC.and, '&&'],
  [PREC.or, '||'],
];

// Where operands stand side by side, `a -b` is two and `a-b`, `a - b` are one: an operator touches what
// stands before it, or is followed by space.
const BETWEEN = {
  '+': [token.immediate(prec(1, '+')), /\+\s/],
  '-': [token.immediate(prec(1, '-')), /-\s/],
};

// POV-Ray's directives that plsys doesn't have, each one token: those with a condition or parameters in brackets,
// those that fill a line, and words alone.
const DIRECTIVE_WITH_BRACKETS = ['case', 'elseif', 'for', 'if', 'ifdef', 'ifndef', 'macro', 'range', 'switch', 'while'];
const DIRECTIVE_LINE = [
  'debug', 'default', 'define', 'error', 'fclose', 'fopen', 'read', 'render', 'statistics', 'undef', 'version',
  'warning', 'write',
];

// Bracketed text in a line, up to three deep.
const BRACKETS = [1, 2].reduce((inner) => `\\(([^()\\r\\n]|${inner})*\\)`, '\\([^()\\r\\n]*\\)');

const WORD_CHARACTERS = '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ_abcdefghijklmnopqrstuvwxyz';

/** A regular expression for all words but `words`: tree-sitter's have no look-ahead. */
function wordsBut(words) {
  const heads = [...new Set(words.map((word) => word[0]))].filter(Boolean);
  const others = [...WORD_CHARACTERS].filter((character) => !heads.includes(character)).join('');
  const longer = heads.map((head) => head + wordsBut(words.filter((word) => word[0] === head).map((word) => word.slice(1))));
  return `(${[`[${others}][A-Za-z0-9_]*`, ...longer].join('|')})${words.includes('') ? '' : '?'}`;
}

const oneOf = (rules) => (rules.length > 1 ? choice(...rules) : rules[0]);

/** Binary expressions over `operand`, one alternative a level of precedence. */
function binary(levels, operand, spelling = (operator) => operator) {
  return choice(...levels.map(([level, ...operators]) => prec.left(level, seq(
    field('left', operand),
    field('operator', oneOf(operators.map(spelling))),
    field('right', operand),
  ))));
}

function unary(operand) {
  return prec(PREC.unary, seq(field('operator', choice('-', '+', '!')), field('operand', operand)));
}

const commaSeparated = (rule) => optional(seq(rule, repeat(seq(',', rule))));

export default grammar({
  name: 'plsys',

  word: ($) => $.name,

  extras: ($) => [/\s/, $.comment, $.directive],

  reserved: {
    global: (_) => ['Selection', 'Calculation', 'Transformation', 'Parameter', 'if', 'else'],
  },

  supertypes: ($) => [$._definition, $._expression, $._statement],

  // `#declare White = rgb 1  plane { … }` needs no ';': only the '{' tells that `plane` starts a block.
  conflicts: ($) => [[$._declared_items]],

  rules: {
    source_file: ($) => repeat(choice($._definition, alias(choice('}', ')', ']', ';', ','), $.stray))),

    _definition: ($) => choice(
      $.include,
      $.declare,
      $.parameter,
      $.selection,
      $.calculation,
      $.transformation,
      $.named_block,
      $.block,
    ),

    // --- scene blocks

    include: ($) => prec.right(seq(alias(/#[ \t]*include/, '#include'), optional(field('path', $.string)), optional(';'))),

    declare: ($) => prec.right(seq(
      field('keyword', choice(alias(/#[ \t]*declare/, '#declare'), alias(/#[ \t]*local/, '#local'))),
      optional(seq(
        field('name', $.name),
        optional('='),
        optional(choice(field('value', $.block), $._declared_items)),
      )),
      optional(';'),
    )),

    _declared_items: ($) => seq(field('value', $._item), repeat(choice(field('value', $._item), ','))),

    parameter: ($) => prec.right(seq(
      'Parameter',
      optional(field('name', $.name)),
      optional(seq('=', field('value', $._expression))),
      optional(field('range', $.range)),
      optional(field('text', $.string)),
      optional(';'),
    )),

    range: ($) => prec.right(seq(
      '[',
      field('low', $._expression),
      choice('to', ',', ':'),
      field('high', $._expression),
      optional(']'),
    )),

    // `Texture Bark { … }`: a block that defines a name.
    named_block: ($) => seq(field('kind', $.name), field('name', $.name), field('body', $.block_body)),

    block: ($) => prec(1, seq(field('name', $.name), field('body', $.block_body))),

    block_body: ($) => prec.right(seq(
      '{',
      repeat(choice($._item, $.block, $.map_entry, ',', alias($._block_stray, $.stray))),
      optional('}'),
    )),

    map_entry: ($) => prec.right(seq('[', repeat(choice($._item, $.block, ',')), optional(']'))),

    _block_stray: (_) => choice(';', ':', '=', '->', '=>', '|', '==', '&&', '||', '++', '--', '+=', '-=', '*=', '/='),

    // --- PL-systems

    selection: ($) => prec.right(seq(
      'Selection',
      optional(field('name', $.name)),
      optional(field('parameters', $.parameters)),
      optional(field('body', $.selection_body)),
    )),

    parameters: ($) => seq('(', commaSeparated($.name), ')'),

    selection_body: ($) => prec.right(seq('{', repeat($._production), optional('}'))),

    // Guards and rules stand flat, as in the text; which `else` belongs to which `if` is the reader's business.
    _production: ($) => choice($.guard, $.rule, $.entry, $.braced, alias(';', $.stray)),

    guard: ($) => prec.right(choice(
      seq(choice('if', 'elseif', 'elif'), field('condition', $._expression)),
      'else',
    )),

    rule: ($) => prec.right(1, seq(
      field('target', choice($.name, $.call)),
      $._arrow,
      optional($._alternatives),
      repeat($.late_rule),
      optional(';'),
    )),

    // The entry action `C_initialize Tree;`, and any rule whose arrow is missing.
    entry: ($) => prec.right(seq($.union, repeat($.late_rule), optional(';'))),

    // After a missing ';': in `A -> x B -> y;`, B is read as an operand of A's rule until its arrow comes.
    late_rule: ($) => prec.right(seq($._arrow, optional($._alternatives))),

    // Braces round rules: a habit from C that the reader explains.
    braced: ($) => prec.right(seq('{', repeat($._production), optional('}'))),

    _arrow: ($) => field('arrow', alias(choice('->', '=>', '=', '→', /-[ \t]+>/), $.arrow)),

    _alternatives: ($) => prec.right(seq($.alternative, repeat(seq('|', $.alternative)), optional(alias('|', $.stray)))),

    alternative: ($) => prec.right(choice(
      seq(field('weight', choice($.number, $.name, $.call)), ':', optional(field('body', $.union))),
      field('body', $.union),
    )),

    union: ($) => prec.right(seq($.term, repeat(seq('+', $.term)), optional(alias('+', $.stray)))),

    // Operators, outermost first, and last the operand.
    term: ($) => prec.right(repeat1(choice(
      $.name,
      $.call,
      $.group,
      $.inline,
      $.block,
      alias(choice($.number, $.vector, '-', '*', ','), $.stray),
    ))),

    group: ($) => prec.right(seq('(', optional($.union), optional(')'))),

    inline: ($) => prec.right(seq('[', repeat(choice($._statement, alias(';', $.stray))), optional(']'))),

    // --- Calculations and Transformations

    calculation: ($) => prec.right(seq(
      'Calculation',
      optional(field('name', $.name)),
      optional(field('parameters', $.parameters)),
      optional(field('body', $.statements)),
    )),

    transformation: ($) => prec.right(seq(
      'Transformation',
      optional(field('name', $.name)),
      optional(field('parameters', $.parameters)),
      optional(field('body', $.statements)),
    )),

    statements: ($) => prec.right(seq(
      '{',
      repeat($._statements_part),
      optional('}'),
    )),

    // Scene blocks, `if` and braces have no place here; they parse so that the reader can say so.
    _statements_part: ($) => choice(
      $._statement,
      $.block,
      $.guard,
      alias($.braced_statements, $.braced),
      alias(choice(';', ','), $.stray),
    ),

    braced_statements: ($) => prec.right(seq('{', repeat($._statements_part), optional('}'))),

    _statement: ($) => choice($.assignment, $.step, $.operation),

    assignment: ($) => prec.right(seq(
      field('target', $.name),
      field('operator', choice('=', '+=', '-=', '*=', '/=')),
      field('value', $._expression),
      optional(';'),
    )),

    step: ($) => prec.right(1, seq(
      choice(
        seq(field('operator', choice('++', '--')), field('target', $.name)),
        seq(field('target', $.name), field('operator', choice('++', '--'))),
      ),
      optional(';'),
    )),

    operation: ($) => prec.right(seq(
      choice(
        seq(field('name', $.name), repeat(choice(field('argument', $._item), ','))),
        field('call', $.call),
      ),
      optional(';'),
    )),

    // --- expressions: everything; without comparisons, inside < >; and side by side

    _expression: ($) => choice($.conditional, $.binary, $.unary, $._primary, alias($.spaced_call, $.call)),

    conditional: ($) => prec.right(PREC.conditional, seq(
      field('test', $._expression),
      '?',
      field('then', $._expression),
      ':',
      field('otherwise', $._expression),
    )),

    binary: ($) => binary([...ARITHMETIC, ...COMPARISON], $._expression),
    unary: ($) => unary($._expression),

    _component: ($) => choice(
      alias($.component_binary, $.binary),
      alias($.component_unary, $.unary),
      $._primary,
      alias($.spaced_call, $.call),
    ),
    component_binary: ($) => binary(ARITHMETIC, $._component),
    component_unary: ($) => unary($._component),

    _item: ($) => choice(alias($.item_binary, $.binary), alias($.item_unary, $.unary), $._primary),
    item_binary: ($) => binary(ARITHMETIC, $._item, (operator) =>
      operator in BETWEEN ? choice(...BETWEEN[operator].map((spelling) => alias(spelling, operator))) : operator),
    item_unary: ($) => unary($._item),

    _primary: ($) => choice($.number, $.string, $.name, $.call, $.vector, $.parenthesized),

    // More than one expression is a vector in the wrong brackets.
    parenthesized: ($) => seq('(', $._expression, repeat(seq(',', $._expression)), ')'),

    call: ($) => seq(field('name', $.name), token.immediate('('), commaSeparated(field('argument', $._expression)), ')'),

    // `sin (x)`: where no operand can follow, a call by mistake.
    spaced_call: ($) => prec(1, seq(field('name', $.name), '(', commaSeparated(field('argument', $._expression)), ')')),

    vector: ($) => seq('<', commaSeparated(field('component', $._component)), '>'),

    // --- tokens; malformed ones (`2x`, `.5`, an unclosed string) are whole, for the reader to explain

    // Letters outside of ASCII are for the reader to complain about, once a name.
    name: (_) => /[A-Za-z_\u00C0-\u1FFF\u2C00-\uD7FF][A-Za-z0-9_\u00C0-\u1FFF\u2C00-\uD7FF]*/,

    number: (_) => token(choice(
      /[0-9]+(\.[0-9]+)?[eE][+-][0-9]+[A-Za-z0-9_.]*/,
      /\.?[0-9][A-Za-z0-9_.]*/,
    )),

    string: (_) => /"([^"\\\r\n]|\\[^\r\n])*\\?"?/,

    comment: (_) => token(choice(
      /\/\/[^\r\n]*/,
      /\/\*([^*]|\*+[^*\/])*(\*+\/?)?/,
    )),

    directive: (_) => token(choice(
      new RegExp(`#[ \\t]*(${DIRECTIVE_WITH_BRACKETS.join('|')})([ \\t]+[A-Za-z0-9_]+)?[ \\t]*${BRACKETS}`),
      new RegExp(`#[ \\t]*(${DIRECTIVE_LINE.join('|')})([^A-Za-z0-9_\\r\\n][^\\r\\n]*)?`),
      new RegExp(`#[ \\t]*${wordsBut(['declare', 'include', 'local'])}`),
    )),
  },
});
