"""Call hierarchy: the production graph."""

from __future__ import annotations

from tests.lsp.editor import Editor

SCENE = """\
object { Tree texture { Bark } }
#declare Bark = texture { pigment { color rgb 1 } }
Selection Tree
{
    C_init Tree;
    if (n > 0) Tree -> C_less Tree + C_less T_up Tw<cursor>ig;
    else       Tree -> Twig;
}
Selection Twig { Twig -> T_up box; }
Calculation C_init { n = 3; }
Calculation C_less { --n; }
Transformation T_up { trans 0 0 n; }
"""


def test_incoming():
    editor = Editor(SCENE)
    (item,) = editor.at_cursor("textDocument/prepareCallHierarchy")
    assert item["name"] == "Twig" and editor.text_of(item["selectionRange"]) == "Twig" and item["detail"] == "selection"
    (call,) = editor.request("callHierarchy/incomingCalls", {"item": item})
    assert call["from"]["name"] == "Tree" and [each["start"]["line"] for each in call["fromRanges"]] == [5, 6]
    calls = editor.request("callHierarchy/incomingCalls", {"item": call["from"]})
    assert [each["from"]["name"] for each in calls] == ["object", "Tree"]
    assert editor.request("callHierarchy/incomingCalls", {"item": calls[0]["from"]}) == []


def test_outgoing():
    editor = Editor(SCENE.replace("<cursor>", "").replace("object { Tree", "object { Tr<cursor>ee"))
    (item,) = editor.at_cursor("textDocument/prepareCallHierarchy")
    calls = editor.request("callHierarchy/outgoingCalls", {"item": item})
    assert [(each["to"]["name"], len(each["fromRanges"])) for each in calls] == [
        ("C_init", 1), ("Tree", 2), ("C_less", 2), ("T_up", 1), ("Twig", 2),
    ]  # fmt: skip
    calls = editor.request("callHierarchy/outgoingCalls", {"item": calls[-1]["to"]})
    assert [each["to"]["name"] for each in calls] == ["T_up"]


def test_from_an_object_on():
    editor = Editor(SCENE.replace("<cursor>", "").replace("Selection Tree", "Selection Tr<cursor>ee"))
    (item,) = editor.at_cursor("textDocument/prepareCallHierarchy")
    start = editor.request("callHierarchy/incomingCalls", {"item": item})[0]["from"]
    calls = editor.request("callHierarchy/outgoingCalls", {"item": start})
    assert [each["to"]["name"] for each in calls] == ["Tree", "Bark"]


def test_across_files(tmp_path):
    files = {"main.plsys": '#include "lib.plsys"\nobject { Tr<cursor>ee }\n', "lib.plsys": "Selection Tree { Tree -> box; }\n"}
    editor = Editor(files, tmp_path)
    (item,) = editor.at_cursor("textDocument/prepareCallHierarchy")
    assert item["uri"] == editor.uri("lib.plsys")
    (call,) = editor.request("callHierarchy/incomingCalls", {"item": item})
    assert call["from"]["uri"] == editor.uri("main.plsys")


def test_parameters_are_no_nodes():
    assert Editor(SCENE.replace("<cursor>", "").replace("--n", "--n<cursor>")).at_cursor("textDocument/prepareCallHierarchy") is None
