"""The façade of the compiler for editors: what a file says at a place, at typing speed.

Files are :class:`Document`\\ s in a :class:`Project`; a document is a list of blocks, each with a syntax tree, names and
messages of its own, so that an edit costs what it touched (text, split, facts, scene). All offsets are bytes.

Example::

    from plsys.compiler.analysis import Project

    project = Project()
    document = project.open(path, data)
    scene = project.scene_of(document)
    project.work()
    for message in scene.messages(document): …
    name, place = document.name_at(offset)
    scene.meaning(name).definitions, scene.uses(name)
"""

from ..reading import syntax, vocabulary
from ..reading.codes import CODES
from ..reading.diagnostics import Diagnostic, PlsysError, nearest
from ..reading.source import Span
from .context import Context, context_at
from . import queries
from .actions import Action, TextEdit, line_break
from .deadline import Deadline
from .document import Document, Meaning, Message, Outline, Place
from .facts import Definition, Facts, Name, facts_of, prepare_messages
from .keys import enters_keys
from .fixes import fix_all, fixes, ignoring
from .folders import SUFFIX as SCENE_SUFFIX
from .folders import Folders, Found
from .format import Formatted, format_document, preparing_format
from .insights import GuardInsight, Insight, SymbolInsight, ValueInsight, insights_in, insights_of
from .motion import Motion, constant_of, motion_of, stretching_of
from .project import Project
from .refactor import refactorings
from .scene import Scene
from .text import Block, Change, Text
from .whole import Checker, Result
from .whole import run as check_whole
from .worker import give_turns

__all__ = [
    "Action", "Block", "CODES", "Change", "Checker", "Context", "Deadline", "Definition", "Diagnostic", "Document", "Facts", "Folders",
    "Formatted", "Found", "GuardInsight", "Insight", "Meaning", "Message", "Motion", "Name", "Outline", "Place", "PlsysError", "Project", "Result",
    "SCENE_SUFFIX", "Scene", "Span", "SymbolInsight", "Text", "TextEdit", "ValueInsight", "check_whole", "constant_of", "context_at", "enters_keys", "facts_of", "fix_all", "fixes",
    "format_document", "give_turns", "ignoring", "insights_in", "insights_of", "line_break", "motion_of", "nearest", "prepare_messages", "preparing_format", "queries", "refactorings", "stretching_of", "syntax", "vocabulary",
]  # fmt: skip
