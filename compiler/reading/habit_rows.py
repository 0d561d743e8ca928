r"""The table of habits from other languages; :mod:`habits` says how it is used.

A pattern is matched against a line whose comments are blank and whose strings hold underscores only. What the message is
about is the group ``at``, which ``\0`` in a text stands for; ``\1`` and on are groups. The first row that fits counts, so that
special ones stand before general ones. A pattern that begins with a word says so (``\b``), and takes it whole
(``\w++``): tried at each letter of each word, it would cost the square of their lengths.

Example: ``Habit(_RULES, r"-{2,}>", "'-->' stands …", mend="->")`` is for ``A --> box;`` and writes ``->`` instead.
"""

from __future__ import annotations

import re
from typing import Callable, NamedTuple

from . import vocabulary


class Habit(NamedTuple):
    """``where``: the contexts of :meth:`habits._Text.context`. ``needs``: texts of which the pattern has one for sure; to look for
    these takes less time. ``mend``: what stands in its place instead, a text or
    a function of what stands there; None if only the author can know. ``hint``: empty for "write " and the mend."""

    where: tuple[str, ...]
    pattern: re.Pattern[str]
    message: str
    hint: str = ""
    mend: str | Callable[[str], str] | None = None
    code: str = "syntax"
    needs: tuple[str, ...] = ()


def _row(
    where: tuple[str, ...],
    pattern: str,
    message: str,
    hint: str = "",
    mend=None,
    code: str = "syntax",
    needs: tuple[str, ...] = (),
) -> Habit:
    return Habit(where, re.compile(pattern, re.ASCII | re.MULTILINE), message, hint, mend, code, needs)


def _words(*names: str) -> str:
    return rf"\b(?:{'|'.join(sorted(names, key=len, reverse=True))})\b"


_NUMBER = r"-?\d+(?:\.\d+)?(?![\w.])"  # the whole of it
_VALUE = r"[\w.*/+-]+"
_INNER = r"(?:[^();{}]|\([^();{}]*\))*?"  # what a bracket holds, one level of brackets deep
_OPERATION = _words(*vocabulary.OPERATIONS)
_FUNCTION = _words(*vocabulary.FUNCTIONS)
_BLOCK = _words(*vocabulary.BLOCKS)
_PRIMITIVE = _words(*vocabulary.PRIMITIVES)
_TYPES = ("int", "integer", "float", "double", "real", "number", "bool", "auto", "var", "let", "const", "local")
_TYPE = _words(*_TYPES)
_JUMPS = ("switch", "case", "for", "while", "do", "repeat", "foreach", "return")
_OPERATIONS, _FUNCTIONS = tuple(vocabulary.OPERATIONS), tuple(vocabulary.FUNCTIONS)
_KEYWORD = r"\b(?:Selection|Calculation|Transformation|Parameter|Texture)"
_ARROW = r"(?:->|=>)"
_SIGNED = r"\b[A-Za-z_]\w*+(?:-[A-Za-z_]\w*+)+\b"
_HAS_SIGN = r"the name '\0' has a sign in it"

_TOP, _HEAD, _RULES, _STATEMENTS, _PARAMETER, _BLOCKS = (
    (name,) for name in ("top", "head", "rules", "statements", "parameter", "block")
)  # fmt: skip
_PL = _RULES + _STATEMENTS
_ANY = _TOP + _HEAD + _PL + _PARAMETER + _BLOCKS


def _without_signs(text: str) -> str:
    return text.replace("-", "_")


def _with_commas(text: str) -> str:
    opener, inside, closer = re.fullmatch(r"(.*?[(<])(.*)([)>])", text, re.DOTALL).groups()
    return opener + ", ".join(re.split(r"[\s;,]+", inside.strip())) + closer


def _rgb(text: str) -> str:
    parts = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return f"rgb <{', '.join(f'{part:.3g}' for part in parts)}>"


HABITS: tuple[Habit, ...] = (
    # words
    _row(_RULES, r"(?P<at>\b(?:If|IF|iF)\b)[^;]*", r"'\0' is written in small letters", mend="if", needs=("If", "IF", "iF")),
    _row(_RULES, r"(?P<at>\bE(?:lse|LSE)\b)[^;]*", r"'\0' is written in small letters", mend="else", needs=("Else", "ELSE")),
    _row(_RULES, r"(?P<at>\b(?:elsif|elsef|elseIf|ElseIf|ELSEIF|Elseif|Elif|ELIF|Elsif)\b)[^;]*", r"'\0' is written as two words", mend="else if", needs=("lsif", "lsef", "lseI", "LSEI", "lsei", "Elif", "ELIF")),
    # L-systems
    _row(_RULES, r"(?P<at>\[\s*(?:\+(?!\+)|-(?!-)|[&^/\\|]))[^;]*", "in plsys '[' … ']' doesn't branch, and a sign doesn't turn",
         "'+' joins, and operators stand before what they act on: F + [ trans 0 0 1; roty 25 ] F", needs=("[",)),
    _row(_RULES, rf"(?P<at>(\w+)(?:\([^()]*\))?\s*:\s*({_INNER}[<>=!]{_INNER})\s*{_ARROW})", "a condition stands before its rule",
         mend=r"if (\3) \2 ->", needs=(":",)),
    _row(_RULES, rf"[{{;]\s*(?P<at>(?!if\b)([^;{{}}:\s][^;{{}}:]*?[<>=!][^;{{}}:]*?)\s*:)\s*\w+\s*{_ARROW}", "a condition stands in an `if`", mend=r"if (\2)", needs=(":",)),
    _row(_RULES, rf"(?P<at>{_words(*_JUMPS)})\s*[\w({{][^;]*", r"plsys has no '\0': a Selection chooses and repeats",
         "write if (n > 0) A -> …; else A -> …; with [ --n ] on the way back to A", needs=_JUMPS),
    _row(_RULES, r"\bif\s+(?P<at>(?!\()([^(){};:]+|[^{};:]*\([^{};:]*)\s*:)(?=\s*\w+\s*->)", "a condition stands in brackets", mend=r"(\2)", needs=(":",)),
    _row(_RULES, rf"\bif\s*\({_INNER}\)\s*(?P<at>:)\s*\w", "no ':' stands between a condition and its rule", mend="", needs=(":",)),
    _row(_RULES, r"\belse\s*(?P<at>:)\s*\w", "no ':' stands behind 'else'", mend="", needs=(":",)),
    _row(_RULES, r"\w\)?\s*(?P<at>::=|:=|:-|:)(?!=)", r"'\0' stands where a rule has '->'", mend="->", needs=(":",)),
    _row(_RULES, r"(?:\w\)?)?\s*(?P<at>-{2,}>|={2,}>|~>|<-{1,2}(?!\d)|<=(?=\s*\w+;))", r"'\0' stands where a rule has '->'", mend="->", needs=("-->", "==>", "~>", "<-", "<=")),
    _row(_TOP, r"^\s*(?P<at>(?:[Aa]xiom|[Ss]tart|ω)\s*[:=]?\s*(\w+))[^\r\n]*", "a scene's start symbol is placed by a block",
         mend=r"object { \2 }"),
    _row(_TOP, r"^\s*(?P<at>(\w+)(?:\([^()]*\))?\s*(?:->|=>|→)[^;{}\r\n]*;?)", "a rule stands in a Selection", r"write Selection \2 { \2 -> …; }",
         lambda text: f"Selection {re.match(r'[A-Za-z0-9_]+', text)[0]} {{ {text.rstrip(';')}; }}"),
    _row(_RULES, r"(?P<at>(\d+(?:\.\d+)?)\s*%)\s*:", "a weight is a number without '%'", mend=r"\2", needs=("%",)),
    _row(_RULES, r"(?:->|\|)\s*(?P<at>-\s*)\d[\d.]*\s*:", "a weight can't be negative", "remove the sign", "", needs=(":",)),
    _row(_RULES, r"(?:->|\|)\s*(?P<at>\(\s*(\d+(?:\.\d+)?)\s*\)\s*)(?=[\w\[])", "a weight is followed by ':'", mend=r"\2: "),
    _row(_RULES, r"(?:->|\|)\s*(?P<at>(\d+(?:\.\d+)?))\s+\w[^;]*\||\|\s*(\d+(?:\.\d+)?)\s+\w", "a weight is followed by ':'",
         "write A -> 3: x | 1: y;", needs=("|",)),
    # operators and operands of rules
    _row(_RULES, rf"(?P<at>\b(?=[\w-]*\w\w){_SIGNED})", _HAS_SIGN, mend=_without_signs),
    _row(_RULES, r"\b(\w++)(?:\([^()]*\))?\s*+->(?=[^;]*->)(?:(?!\belse\b|\bif\b|->|;).)*?\b(?!\1\b)\w+\)?\s*(?P<at>->)\s*[\w(\[]", "a rule has one '->'", "'+' joins what it produces", "+"),
    _row(_RULES, rf"(?P<at>\[\s*({_NUMBER}(?:\s+{_NUMBER}|\s*,\s*{_NUMBER}){{2}})\s*\])", "the name of an operation stands before its numbers", mend=r"[ trans \2 ]", needs=("[",)),
    _row(_RULES, rf"(?:{_ARROW}|[+(\]])\s*(?P<at>\[\s*{_NUMBER}(?:[\s,]+{_NUMBER})*\s*\])", "the name of an operation stands before its numbers", "write [ trans 0 0 1 ], or [ scale 0.5 ]", needs=("[",)),
    _row(_RULES, rf"{_ARROW}\s*(?P<at>(\w+\s*[-+*/]?=(?![=>])\s*{_NUMBER}))(?=\s*[A-Za-z_(\[])", "what changes a parameter stands in square brackets", mend=r"[ \2 ]", needs=("=",)),
    _row(_RULES, rf"(?P<at>\(\s*({_OPERATION}[^()\[\]{{}};]*)\))", "operators with arguments stand in square brackets", mend=r"[ \2 ]", needs=_OPERATIONS),
    _row(_RULES, rf"(?:{_ARROW}|\+)?\s*(?P<at>\{{\s*((?:{_OPERATION}|--|\+\+|\w+\s*[-+*/]?=(?![=>]))[^{{}}\[\]]*?)\s*\}})\s*[\w(\[]",
         "operators stand in square brackets", mend=r"[ \2 ]", needs=("{",)),
    _row(_RULES, rf"(?P<at>({_OPERATION}(?:[\s,]+{_NUMBER})+))(?=\s*[A-Za-z_(\[])", "operators with arguments stand in square brackets", mend=r"[ \2 ]", needs=_OPERATIONS),
    _row(_RULES, rf"{_ARROW}\s*(?:\w+\s+)*?(?P<at>((?:--|\+\+)\s*\w+|\w+\s*(?:--|\+\+)))(?=\s*[\w(\[])", "what changes a parameter stands in square brackets",
         mend=r"[ \2 ]", needs=("--", "++")),
    _row(_RULES, rf"{_ARROW}\s*(?P<at>(\w+\s*[-+*/]?=(?![=>])\s*[^;,]+?)\s*,)", "what changes a parameter stands in square brackets", mend=r"[ \2 ]", needs=(",",)),
    _row(_RULES, rf"(?:^|[{{;])\s*(?P<at>{_ARROW})", r"the name of a Selection stands before '\0'", "a rule looks like Name -> operators operand + …;", code="missing"),
    _row(_RULES, rf"(?P<at>({_PRIMITIVE})\s+({_NUMBER}|\"_*\"))", "arguments stand in brackets", mend=r"\2(\3)"),
    _row(_RULES, r"(?P<at>\bmesh\s*\(\s*([\w./-]+\.\w+)\s*\))", "a file's name stands in quotation marks", mend=r'mesh("\2")', needs=("mesh",)),
    _row(_RULES, rf"(?P<at>\b(?!{_OPERATION})([A-Za-z_]\w*+)\s++({_NUMBER}(?:[\s,]+{_NUMBER})*))\s*(?=[;|+)]|$)", "arguments stand in brackets",
         mend=lambda text: _with_commas(re.sub(r"\s+", "(", text, count=1) + ")")),
    _row(_RULES, rf"(?P<at>\b(\w+)\s*[\[<]\s*({_VALUE}(?:\s*,\s*{_VALUE})+|{_NUMBER})\s*[\]>])", "arguments stand in round brackets", mend=r"\2(\3)", needs=("[", "<")),
    _row(_RULES, r"(?P<at>(?!if\b)\b(\w++)\s++\(([^();]*[\d,*/%-][^();]*)\))", "a space stands between a symbol and its arguments", mend=r"\2(\3)"),
    _row(_RULES, rf"{_ARROW}\s*(?P<at>\+)", "nothing stands before this '+'", "remove it: '+' joins two operands", "", needs=("+",)),
    _row(_RULES, rf"{_ARROW}(?:\s*\b\w+)*?\s*(?P<at>(\d[\w.]*)\s*\*)\s*\w", "a number doesn't multiply an operand",
         r"write [ scale \2 ] for another size; a Selection repeats: Row -> box + [ --n; trans 1 0 0 ] Row", needs=("*",)),
    _row(_RULES, rf"(?!{_PRIMITIVE})\b[A-Za-z_]\w*\s*(?P<at>\*)\s*[\w(\[]", "an operator stands before its operand without a sign", mend="", needs=("*",)),
    _row(_RULES, r"[\w\])](?P<at>\s*,)\s*(?!else\b)[\w(\[]", "',' doesn't join what a rule produces", mend=" +", needs=(",",)),
    _row(_RULES, r"(?P<at>,)\s*else\b", "',' doesn't end a rule", mend=";", needs=(",",)),
    # how rules choose
    _row(_RULES, r"\)\s*(?P<at>then\b)\s*", "no 'then' stands between a condition and its rule", mend="", needs=("then",)),
    _row(_RULES, rf"\bif\s+(?P<at>(?!\()({_INNER}\)))\s*\w+\s*{_ARROW}", "this condition lacks its '('", mend=r"(\2", needs=("if",)),
    _row(_RULES, rf"(?P<at>\b(\w++)\s*+{_ARROW}\s*(if\s*\({_INNER}\)))[^;]*;?", "a condition stands before its rule", mend=r"\3 \2 ->", needs=("if",)),
    _row(_RULES, rf"(?P<at>\b(\w++)\s*+{_ARROW}\s*\(({_INNER}(?:[<>]|[=!]=){_INNER})\))", "a condition stands before its rule", mend=r"if (\3) \2 ->"),
    _row(_RULES, rf"(?P<at>\b(\w+)\s*{_ARROW}\s*([^;?\[\]]*?)\s*\?\s*([^;:?]*?)\s*:\s*([^;:?]*?)\s*;)", "a rule chooses by `if`",
         mend=r"if (\3) \2 -> \4; else \2 -> \5;", needs=("?",)),
    # conditions and expressions
    _row(_PL, rf"\bif\s*\({_INNER}(?P<at>=<)", r"'\0' is no operator", mend="<=", needs=("=<",)),
    _row(_PL, rf"\bif\s*\({_INNER}(?P<at>=>)", r"'\0' is no operator", mend=">=", needs=("=>",)),
    _row(_PL, r"(?P<at>===)", r"'\0' is no operator", mend="==", needs=("===",)),
    _row(_PL, r"(?P<at>!==|<>|~=|=/=)", r"'\0' is no operator", mend="!=", needs=("!==", "<>", "~=", "=/=")),
    _row(_PL, rf"\bif\s*\({_INNER}(?P<at>(?<!\|)\|(?!\|))", r"'\0' is no operator", mend="||", needs=("|",)),
    _row(_PL, rf"\bif\s*\({_INNER}(?P<at>(?<!&)&(?!&)|\b(?:and|AND)\b)", r"'\0' is no operator", mend="&&", needs=("&", "and", "AND")),
    _row(_PL, rf"\bif\s*\({_INNER}(?P<at>\b(?:or|OR)\b)", r"'\0' is no operator", mend="||", needs=("or", "OR")),
    _row(_PL, rf"\bif\s*\({_INNER}(?P<at>\b(?:not|NOT)\b\s*)(?=[\w(])", r"'\0' is no operator", "write !", "!", needs=("not", "NOT")),
    _row(_ANY, r"(?P<at>((?<![\w.])[\w.]+|\([^()]*\))\s*(?:\*\*|\^)\s*([\w.]+|\([^()]*\)))", "a power is written with a function", mend=r"pow(\2, \3)", needs=("**", "^")),
    _row(_PL, r"[\w)]\s*(?P<at>\bmod\b)[^;]*", r"'\0' is no operator", mend="%", needs=("mod",)),
    _row(_PL, rf"(?P<at>({_FUNCTION})\s+(-?[\w.]+))\s*[;)\],+*/-]", "a function's arguments stand in brackets", mend=r"\2(\3)", needs=_FUNCTIONS),
    _row(_PL, rf"(?P<at>({_FUNCTION})[\[{{]([^][{{}}]*)[\]}}])", "a function's arguments stand in round brackets", mend=r"\2(\3)", needs=("[", "{")),
    _row(_PL, r"(?P<at>\b(?:[Mm]ath|std|np|numpy)(?:\.|::))\w+", r"plsys has no '\0' before its functions", mend="", needs=("ath", "std", "np", "numpy")),
    _row(_PL, rf"(?P<at>\b\w++\(\s*{_NUMBER}(?:\s+{_NUMBER})+\s*\))", "a comma stands between two arguments", mend=_with_commas, needs=("(",)),
    _row(_PL + _BLOCKS, r"(?P<at>,)\s*[)>]", "nothing stands after this ','", "remove it", "", needs=(",",)),
    _row(_PL + _BLOCKS, r"(?:[(<]|[(<][^<>();{}]*,)\s*(?P<at>,)", "nothing stands before this ','", "remove it", "", needs=(",",)),
    # statements
    _row(_STATEMENTS, rf"[{{;]\s*(?P<at>{_SIGNED})\s*[-+*/]?=", _HAS_SIGN, mend=_without_signs, needs=("=",)),
    _row(_STATEMENTS, r"[{;]\s*\w+\s*(?P<at>==)\s*[^;]*;", "'==' compares", "a single '=' assigns", "=", needs=("==",)),
    _row(_ANY, r"(?P<at>:=)", "':=' is no operator", mend="=", needs=(":=",)),
    _row(_STATEMENTS, rf"=\s*(?P<at>if\s*\(({_INNER})\)\s*(?:then\s+)?([^;]+?)\s+else\s+([^;]+?))\s*;", "a value chooses by '?' and ':'", mend=r"\2 ? \3 : \4", needs=("if",)),
    _row(_STATEMENTS, r"=\s*(?P<at>([^;=]+?)\s+if\s+([^;]+?)\s+else\s+([^;]+?))\s*;", "a value chooses by '?' and ':'", mend=r"\3 ? \2 : \4", needs=("if",)),
    _row(_STATEMENTS, r"(?P<at>\?)[^:;]*;", "this '?' lacks its ':'", "a choice looks like n > 0 ? 1 : 2", None, "missing", needs=("?",)),
    _row(_STATEMENTS, r"(?P<at>\b(\w+)\b\s*=\s*(\w+)\s*=(?!=)\s*([^;=]+))", "a statement assigns to one name", mend=r"\3 = \4; \2 = \3", needs=("=",)),
    _row(_ANY, r"(?P<at>\b\d{1,3}(?:'\d{3})+)", "a number has no signs between its digits", mend=lambda text: text.replace("'", ""), needs=("'",)),
    _row(_STATEMENTS, r"=\s*(?P<at>(-?\d+),(\d+))\s*;", "a number has a point, not a comma", mend=r"\2.\3", needs=(",",)),
    _row(_STATEMENTS, rf"(?P<at>,)\s*(?:\w+\s*[-+*/]?=(?!=)|{_OPERATION})", "a statement ends with ';'", mend=";", needs=(",",)),
    _row(_STATEMENTS, r"\{[^{}]*=\s*(?P<at>[\[{]([^][{};]*)[\]}])", "in an expression brackets are round", mend=r"(\2)", needs=("=",)),
    _row(_PL, rf"({_OPERATION})(?P<at>\s*[=:]\s*){_NUMBER}[^;]*", "an operation's arguments follow its name", "remove the sign", " ", needs=("=", ":")),
    _row(_PL, rf"({_OPERATION})(?P<at>\s*[\[{{(<]([^][{{}}()<>;]*)[\]}})>])", "an operation's arguments stand without brackets", "remove them", r" \3"),
    _row(_STATEMENTS, r"=\s*(?P<at>(?:\d[\w.]*|\w+)\s+\d[\w.]*)\s*;", "an operator is missing between two values", "write a*b, or a + b", needs=("=",)),
    _row(_PL + _HEAD + _PARAMETER, rf"(?P<at>{_TYPE}\s+)(?=\w)", r"values have no types: plsys has no '\0'", "remove it", "", needs=_TYPES),
    _row(_TOP, rf"^\s*(?P<at>{_TYPE}|declare\b|define\b)\s+\w+\s*=", "a value gets its name by #declare", mend="#declare"),
    _row(_TOP, r"^\s*(?P<at>#[ \t]*define\s+(\w+)\s+([^;\r\n]+?)\s*;?)\s*$", "#define isn't supported", mend=r"#declare \2 = \3;", code="unsupported"),
    _row(_TOP, r"^\s*(?P<at>(?:include|import|#import|#use)\s+(\"_*\"))", "a file is included by #include", mend=r"#include \2"),
    _row(_TOP, r"^\s*#include\s*(?P<at><([^<>\r\n]*)>|([\w./-]+\.\w+))", "the file's name stands in quotation marks",
         mend=lambda text: '"' + text.strip("<> ") + '"'),
    # heads of definitions
    _row(_TOP, r"^\s*(?P<at>(?i:param(?:eter)?))\s+\w+\s*=", r"'\0' is written 'Parameter'", mend="Parameter"),
    _row(_TOP, rf"^\s*(?P<at>(?!{_BLOCK}|{_KEYWORD}\b)\w+)\s*=[^=]", "a value gets its name by #declare, outside of Calculations", r"write #declare \0 = …",
         lambda text: f"#declare {text}"),
    _row(_HEAD, rf"{_KEYWORD}\s+\w+\s*(?P<at>=?\s*texture|=|:|->)\s*\{{", "nothing stands between a definition's name and its '{'", "remove it", "", needs=("=", ":", "->", "texture")),
    _row(_HEAD + _TOP, r"\bTexture\s+\w+\s*(?P<at>=?\s*texture)\s*\{", "nothing stands between a Texture's name and its '{'", "remove it", "", needs=("Texture",)),
    _row(_HEAD + _PARAMETER, rf"{_KEYWORD}\s+(?P<at>\d\w*)", r"the name '\0' begins with a digit", "a name begins with a letter: Tree1"),
    _row(_HEAD + _PARAMETER, rf"{_KEYWORD}\s+(?P<at>{_SIGNED})", _HAS_SIGN, mend=_without_signs, needs=("-",)),
    _row(_TOP, rf"^\s*#declare\s+(?P<at>{_SIGNED})\s*=", _HAS_SIGN, mend=_without_signs),
    _row(_HEAD + _PARAMETER, rf"{_KEYWORD}\s+(?P<at>if|else|Selection|Calculation|Transformation|Parameter)\b", r"'\0' is a word of plsys and can't be a name",
         "choose another, such as my_name"),
    _row(_HEAD, rf"{_KEYWORD}\s+\w+\s*\([^(){{}}]*?(?P<at>\s*=\s*[^,(){{}}]+)", "a symbol's parameters have no default values",
         "remove it; a reference gives the value: Tree(3)", "", needs=("=",)),
    _row(_HEAD, rf"{_KEYWORD}\s+\w+\s*(?P<at>,)\s*\w+", "a definition has one name", "write a second one for the other", needs=(",",)),
    _row(_HEAD + _BLOCKS, rf"{_KEYWORD}\s+\w+(?P<at>[ \t]+)\w+\s*\{{", "a name is one word", "join the words by '_'", "_"),
    _row(_HEAD, rf"{_KEYWORD}\s+\w+(?:\([^(){{}}]*\))?(?P<at>\s*(?:=|:|->)\s*|\s+)(?=[^\s{{(=:,>-])[^{{]*(?:\}}|;|$)", "the body of a definition stands in braces",
         "add '{' here", " { ", "missing"),
    _row(_PARAMETER, r"(?:=\s*\S+\s*)?(?P<at>(\"_*\")\s*(\[[^\]]*\]))", "a Parameter's text stands after its range", mend=r"\3 \2"),
    _row(_PARAMETER, rf"(?:=[^;\[(]*?)?(?P<at>[\[(]\s*({_NUMBER}|\w+)\s*(?:\.\.+|-|;|\||to|,|:)\s*({_NUMBER}|\w+)\s*[\])])", "a range stands in square brackets, with 'to'",
         mend=r"[\2 to \3]"),
    _row(_PARAMETER, rf"(?:=\s*\S+\s+)?(?P<at>(?<=\s)({_NUMBER})\s*(?:to|\.\.+)\s*({_NUMBER}))", "a range stands in square brackets, with 'to'", mend=r"[\2 to \3]"),
    _row(_PARAMETER, r"(?P<at>'([^'\"\r\n]*)')", "a text stands in double quotation marks", mend=r'"\2"'),
    _row(_PARAMETER, r"Parameter\s+\w+(?P<at>\s*:\s*|\s+)(?=-?\d)", "a Parameter's value stands after '='", "write =", " = ", "missing"),
    _row(_PARAMETER, r"(?P<at>,)\s*\w+\s*=", "a Parameter statement has one name", "write ; Parameter", "; Parameter"),
    # scene blocks
    _row(_TOP, rf"^\s*{_BLOCK}\s*(?P<at>[=:]+)\s*\{{", "nothing stands between a block's name and its '{'", "remove it", ""),
    _row(_TOP, rf"^\s*(?P<at>({_BLOCK})\s*[(\[]\s*([^()\[\]{{}}]*?)\s*[)\]])", "the items of a block stand in braces", mend=r"\2 { \3 }"),
    _row(_TOP, rf"^\s*(?P<at>({_BLOCK})\s+([^{{}}\s\r\n][^{{}}\r\n]*?))\s*;?\s*$", "the items of a block stand in braces", mend=r"\2 { \3 }"),
    _row(_BLOCKS, r"(?P<at>>>)", "a vector ends with one '>'", mend=">", needs=(">>",)),
    _row(_BLOCKS, r"(?P<at><<)", "a vector starts with one '<'", mend="<", needs=("<<",)),
    _row(_BLOCKS, rf"(?P<at><(?=[^<>]*(?:;|[\w.]\s+[\w.-]))\s*{_VALUE}(?:[\s;,]+{_VALUE})+\s*>)", "a comma stands between two values of a vector",
         mend=_with_commas, needs=("<",)),
    _row(_ANY, r"(?P<at>(?:rgb\s*)?#[0-9a-fA-F]{6})\b", "a colour is written with its components", mend=lambda text: _rgb(text[text.index("#") :]), needs=("#",)),
    # comments
    _row(_TOP, r"^\s*(?P<at>--+|%+|;+|<!--|\(\*|'|!|REM\b|rem\b|#(?=\s))\s*\w[^\r\n]*", "comments start with // or stand between /* and */", "write //", "//"),
)  # fmt: skip
