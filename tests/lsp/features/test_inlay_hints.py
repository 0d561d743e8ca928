"""Inlay hints."""

from __future__ import annotations

from tests.lsp.client import Client
from tests.lsp.editor import Editor, offset_of

TREE = """\
object { Tree }
Selection Tree
{
    C_initialize Tree;
    if (cntTrunk > 0)     Tree -> T_scaleCyl cylinder + C_Trunk T_shiftTrunk Tree;
    else if (cntTree > 0) Tree -> T_scaleCyl cylinder + C_Tree (T_left Tree + T_right Tree);
    else                  Tree -> T_scaleCyl cylinder;
}
Calculation    C_initialize { cntTree = 10; cntTrunk = 2; betaBr = 60.0; }
Calculation    C_Trunk      { --cntTrunk; }
Calculation    C_Tree       { --cntTree; betaBr -= 4.0; }
Transformation T_scaleCyl   { scale 0.15 0.15 2; }
Transformation T_shiftTrunk { trans 0 0 1.99; }
Transformation T_left  { trans 0 0 1.99; roty betaBr; scale 0.8 0.8 0.8; }
Transformation T_right { trans 0 0 1.99; roty -betaBr; rotz 90; scale 0.8 0.8 0.8; }
"""


def hints(editor: Editor, name: str = "scene.plsys", **more) -> list[str]:
    """Each hint as the text before it on its line, and its label in brackets."""
    text = editor.texts[name]
    end = {"line": text.count("\n") + 1, "character": 0}
    params = {"range": {"start": {"line": 0, "character": 0}, "end": end}, **more}
    answer = editor.in_file("textDocument/inlayHint", name, **params)
    found = []
    for each in answer:
        at = offset_of(text, each["position"])
        found.append(f"{text[:at].rpartition(chr(10))[2].strip()} [{each['label']}]")
    return found


def checked(text: str) -> Editor:
    editor = Editor(text)
    editor.check_whole()
    return editor


def test_figure_2_1():
    assert hints(checked(TREE)) == [
        "Selection Tree [2,049 cylinders · depth 13 · ×0.80–1.00 per level]",
        "if (cntTrunk > 0) [runs 2×]",
        "else if (cntTree > 0) [runs 10×]",
        "Calculation    C_Trunk      { --cntTrunk [1 → 0]",
        "Calculation    C_Tree       { --cntTree [9 → 0]",
        "Calculation    C_Tree       { --cntTree; betaBr -= 4.0 [56 → 20]",
        "Transformation T_left  { trans 0 0 1.99; roty betaBr [56° → 20°]",
        "Transformation T_right { trans 0 0 1.99; roty -betaBr [-56° → -20°]",
    ]


def test_only_what_is_asked_for():
    editor = checked(TREE)
    lines = {"start": {"line": 9, "character": 0}, "end": {"line": 9, "character": 30}}
    assert hints(editor, range=lines) == ["Calculation    C_Trunk      { --cntTrunk [1 → 0]"]


def test_hints_move_with_edits_above_and_leave_with_their_block():
    editor = checked(TREE)
    editor.change("object { Tree }", "object { Tree }\n\n// a comment\n")
    assert len(hints(editor)) == 8
    editor.change("betaBr -= 4.0", "betaBr -= 5.0")
    assert not any("betaBr -=" in each for each in hints(editor))
    editor.check_whole()
    assert "Transformation T_left  { trans 0 0 1.99; roty betaBr [55° → 10°]" in hints(editor)


def test_a_broken_scene_keeps_the_hints_of_other_blocks():
    editor = checked(TREE)
    editor.change("scale 0.15 0.15 2;", "scale 0.15 0.15")
    editor.check_whole()
    assert len(hints(editor)) == 8


def test_shares_of_alternatives_and_drawn_values():
    editor = checked(
        "object { A }\nSelection A { A -> 3: [ roty 10 + 20*rand(0) ] box | 1: sphere + [ trans 1 0 0 ] disc; }\n"
    )
    assert hints(editor) == [
        "Selection A [1–2 primitives, about 1.25]",
        "Selection A { A -> 3 [75 %]",
        "Selection A { A -> 3: [ roty 10 + 20*rand(0) [10° … 30°]",
        "Selection A { A -> 3: [ roty 10 + 20*rand(0) ] box | 1 [25 %]",
    ]


def test_parameters_of_a_symbol_come_before_its_hint():
    editor = checked(
        "object { Row(4, 1) }\nSelection Row(n, size) { if (n > 0) Row -> box + [ trans 1 0 0 ] Row(n - 1, size); }\n"
    )
    assert hints(editor) == [
        "Selection Row(n, size) [4 boxes · depth 5]",
        "Selection Row(n, size) { if (n > 0) [runs 4×]",
        "Selection Row(n, size) { if (n > 0) Row -> box + [ trans 1 0 0 ] Row(n - 1 [3 → 0]",
    ]


def test_the_same_is_said_once_a_line():
    editor = checked(
        "object { A(3, 1) }\nSelection A(n, w) { if (n > 0) A -> [ scale n/3 n/3 1 ] box + [ trans 1 0 0; scale 0.985 ] A(n - 1, w/2); }\n"
        "object { B(2, 8) }\nSelection B(m, v) { if (m > 0) B -> [ scale v ] box + B(m - 1, v) + [ v /= 2 ] B(m - 1, v); }\n"
    )
    found = hints(editor)
    assert found[0] == "Selection A(n, w) [3 boxes · depth 4 · ×0.985 per level]"
    assert [each for each in found if "[1 → 0.3333]" in each] == ["Selection A(n, w) { if (n > 0) A -> [ scale n/3 [1 → 0.3333]"]
    assert not any(each.rpartition(" [")[0].endswith("m - 1, v") for each in found)


def test_an_included_file_has_its_hints(tmp_path):
    files = {
        "main.plsys": '#include "lib.plsys"\nobject { Row }\nCalculation C_start { n = 3; }\n',
        "lib.plsys": "Selection Row { C_start Row; if (n > 0) Row -> box + [ --n; trans 1 0 0 ] Row; }\n",
    }
    editor = Editor(files, tmp_path)
    editor.open("lib.plsys", files["lib.plsys"])
    editor.check_whole("main.plsys")
    assert hints(editor, "lib.plsys")[0] == "Selection Row [3 boxes · depth 4]"


def test_the_editor_is_told_when_hints_have_arrived():
    editor = Editor(TREE, client={"workspace": {"inlayHint": {"refreshSupport": True}}})
    assert hints(editor) == []
    from plsys.compiler.analysis.whole import Result, Snapshot, Work

    workspace = editor.session.workspace
    snapshot = Snapshot.of(workspace.scene(workspace.document(editor.uri("scene.plsys"))), 0)
    Work().run(snapshot.request, lambda answer: editor.session._take(Result(snapshot, answer)))
    assert any(message.get("method") == "workspace/inlayHint/refresh" for message in editor.sent)
    assert len(hints(editor)) == 8


def test_a_real_server_works_them_out_beside_the_editing():
    with Client() as client:
        client.initialize({"workspace": {"inlayHint": {"refreshSupport": True}}})
        client.open("untitled:tree.plsys", TREE)
        client.wait_for("workspace/inlayHint/refresh")
        lines = {"start": {"line": 0, "character": 0}, "end": {"line": 3, "character": 0}}
        answer = client.request("textDocument/inlayHint", {"textDocument": {"uri": "untitled:tree.plsys"}, "range": lines})
        assert [each["label"] for each in answer["result"]] == ["2,049 cylinders · depth 13 · ×0.80–1.00 per level"]
