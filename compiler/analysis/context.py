"""What can stand at a place: the construct round the cursor, told from the text before it.

While somebody types, the tree is broken just there; so this looks at the tokens from the block's start to the cursor, and
at brackets that are open. It never looks further than the block.

Example: in ``Selection A { A -> T_up | }`` with the cursor at the bar, the context is ``Context("production", owner="A", …)``:
operators and operands can stand here; in ``camera { loc|`` it is ``Context("block", blocks=("camera",), prefix="loc")``.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from .document import Document

_TOKEN = re.compile(
    rb"//[^\r\n]*|/\*(?:[^*]|\*(?!/))*(?:\*/)?|(?P<string>\"(?:[^\"\\\r\n]|\\[^\r\n])*\"?)|(?P<word>#?[A-Za-z_]\w*)"
    rb"|(?P<number>\.?\d[\w.]*)|(?P<mark>->|=>|\+\+|--|[-+*/%<>=!&|]=|&&|\|\||[^\s\w])"
)
_IGNORE = re.compile(rb"plsys-ignore:(?:[ \t]*[\w-]+[ \t]*,)*[ \t]*([\w-]*)$", re.ASCII)
_KEYWORDS = {"Selection", "Calculation", "Transformation", "Parameter", "Texture", "#declare", "#local", "#include"}
_BODIES = {"Selection": "selection", "Calculation": "calculation", "Transformation": "transformation"}


class Context(NamedTuple):
    """``kind``:

    - ``top``: between definitions · ``name``: a name that is being defined · ``include``: the path of an #include
    - ``selection``: where a rule, a guard or the entry action starts · ``production``: right of an arrow
    - ``statement``: where a statement starts, in a ``calculation``, ``transformation`` or ``inline`` (``owner`` tells the kind)
    - ``arguments``: values of the operation ``function`` · ``call``: inside the brackets of ``function``
    - ``step``: what ``++`` or ``--`` counts · ``input``: a Parameter's value, in its range if ``function`` is ``[``
    - ``expression``: a value, such as a guard's · ``block``: items of a scene block · ``declare``: the value of a #declare
    - ``ignore``: the codes of a ``plsys-ignore`` comment · ``comment``, ``string``: nothing can be completed

    ``owner`` is the definition's name (of statements: the kind of body), ``blocks`` the scene blocks round the cursor,
    outermost first, ``function`` the call or operation with ``argument`` counting from 0, ``prefix`` the part of a word
    before the cursor, ``previous`` the word or mark before that."""

    kind: str
    owner: str = ""
    blocks: tuple[str, ...] = ()
    function: str = ""
    argument: int = 0
    prefix: str = ""
    previous: str = ""


class _Token(str):
    """A token; ``touches`` the one before it, or has a space between."""

    touches: bool = False


class _Open(NamedTuple):
    """A bracket that is open: its mark, what stands before it, and the number of the token after it."""

    mark: str
    before: str
    at: int


def context_at(document: Document, offset: int) -> Context:
    """The context at ``offset``."""
    block, base = document.text.block_at(max(0, offset - 1))
    text = block.data[: offset - base]
    tokens: list[_Token] = []
    end = -1
    for match in _TOKEN.finditer(text):
        if match.lastgroup is None:
            comment = match[0]
            if match.end() == len(text) and not (comment.startswith(b"/*") and comment.endswith(b"*/") and len(comment) > 3):
                ignored = _IGNORE.search(comment)
                return Context("ignore", prefix=ignored[1].decode()) if ignored else Context("comment")
            continue
        tokens.append(_Token(match[0].decode(errors="replace")))
        tokens[-1].touches, end = match.start() == end, match.end()
    prefix = ""
    if tokens and re.fullmatch(r"#?[A-Za-z_]\w*|#", tokens[-1]) and text.endswith(tokens[-1].encode()):
        prefix = tokens.pop()
    elif tokens and tokens[-1].startswith('"') and text.endswith(tokens[-1].encode()) and not _is_closed(tokens[-1]):
        kind = "include" if tokens[:-1][-1:] == ["#include"] else "string"
        return Context(kind, prefix=tokens[-1][1:], previous=tokens[-2] if len(tokens) > 1 else "")
    typed = text[: len(text) - len(prefix.encode())]
    starts_line = typed.endswith((b"\n", b"\r"))
    return _classified(tokens, prefix, starts_line)


def _is_closed(text: str) -> bool:
    return len(text) > 1 and text.endswith('"')


def _classified(tokens: list[_Token], prefix: str, starts_line: bool) -> Context:
    start = max((i for i, token in enumerate(tokens) if token in _KEYWORDS), default=0)
    head = tokens[start] if tokens and tokens[start] in _KEYWORDS else ""
    owner = tokens[start + 1] if head and len(tokens) > start + 1 else ""
    opens: list[_Open] = []
    for i in range(start, len(tokens)):
        token = tokens[i]
        if token in "{[(":
            before = tokens[i - 1] if i else ""
            # With a space between, a bracket of a rule isn't a call's.
            is_apart = token == "(" and head == "Selection" and opens and not token.touches and before not in ("if", "else")
            opens.append(_Open(token, "" if is_apart else before, i + 1))
        elif token in "}])" and opens:
            opens.pop()
            if not opens and token == "}":
                head = ""  # the definition is over
    previous = tokens[-1] if tokens else ""
    if head == "" and not opens:
        return Context("top", prefix=prefix, previous=previous)
    if len(tokens) == start + 1:
        kind = "name" if head != "#include" else "include"
        return Context(kind, prefix=prefix, previous=previous)
    if not opens:
        kind = {"#declare": "declare", "#local": "declare", "Parameter": "input"}.get(head, "top")
        if previous == ";" or starts_line and re.fullmatch(r"[\w.]+|[\])}>]|\".*", previous):
            return Context("top", prefix=prefix, previous=previous)
        return Context(kind, owner, prefix=prefix, previous=previous)
    return _inside(tokens, opens, head, owner, prefix, previous)


def _inside(tokens: list[_Token], opens: list[_Open], head: str, owner: str, prefix: str, previous: str) -> Context:
    inner = opens[-1]
    since = tokens[inner.at :]
    if inner.mark == "(" and re.fullmatch(r"[A-Za-z_]\w*", inner.before) and inner.before not in ("if", "else"):
        if opens[0] is inner and head == "Selection":
            return Context("name", owner, prefix=prefix, previous=previous)
        return Context("call", owner, (), inner.before, _commas(since), prefix, previous)
    if head in _BODIES:
        body = _BODIES.get(head, "")
        if inner.mark == "[" and body == "selection":
            return _statement(since, "inline", prefix, previous)
        if inner.mark == "{" and body in ("calculation", "transformation"):
            return _statement(since, body, prefix, previous)
        if inner.mark == "(" and (inner.before == "if" or "->" not in tokens[opens[0].at : inner.at]):
            return Context("expression", owner, prefix=prefix, previous=previous)
        if body == "selection":
            statement = _last_statement(tokens[opens[0].at :])
            kind = "production" if "->" in statement else "selection"
            return Context(kind, owner, prefix=prefix, previous=previous)
        return Context("expression", owner, prefix=prefix, previous=previous)
    if head == "Parameter":
        return Context("input", owner, (), inner.mark, 0, prefix, previous)
    blocks = tuple(_block_name(each, head) for each in opens if each.mark == "{")
    return Context("block", owner if head else "", blocks, prefix=prefix, previous=previous)


def _block_name(each: _Open, head: str) -> str:
    return "texture" if head == "Texture" and each.at == 3 else each.before


def _statement(since: list[_Token], body: str, prefix: str, previous: str) -> Context:
    statement = _last_statement(since)
    if not statement:
        return Context("statement", body, prefix=prefix, previous=previous)
    if statement in (["++"], ["--"]):
        return Context("step", body, prefix=prefix, previous=previous)
    if any(mark in statement for mark in ("=", "+=", "-=", "*=", "/=")):
        return Context("expression", body, prefix=prefix, previous=previous)
    commas = _commas(statement)
    return Context("arguments", body, (), statement[0], commas or _values(statement[1:]), prefix, previous)


def _values(tokens: list[_Token]) -> int:
    """How many arguments stand side by side. A sign that touches what follows, and nothing before it, begins one."""
    count = depth = 0
    goes_on = False  # an operator's right side is awaited
    for i, token in enumerate(tokens):
        touches_next = i + 1 < len(tokens) and tokens[i + 1].touches
        is_sign = token in "+-!" and touches_next and not token.touches
        if depth == 0 and (re.match(r"[\w.]", token) or token == "(" and not token.touches):
            count += not goes_on
            goes_on = False
        elif depth == 0 and is_sign:
            count += not goes_on
            goes_on = True
        elif depth == 0 and token not in "()":
            goes_on = True
        depth += (token == "(") - (token == ")")
    awaited = goes_on and not (tokens[-1] in "+-" and not tokens[-1].touches)
    return max(0, count - awaited)


def _last_statement(tokens: list[_Token]) -> list[_Token]:
    ends = [i for i, token in enumerate(tokens) if token in ";"]
    return tokens[ends[-1] + 1 :] if ends else tokens


def _commas(tokens: list[str]) -> int:
    depth = count = 0
    for token in tokens:
        depth += (token in "([<{") - (token in ")]>}")
        count += token == "," and depth == 0
    return count
