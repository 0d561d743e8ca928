"""Folders: what isn't open is found, in several roots, as files come and go; and the client is shown that it takes a while."""

from __future__ import annotations

import pytest
from plsys.compiler.analysis import Folders
from tests.lsp.client import Client
from tests.lsp.editor import Editor, Refusal

LIBRARY = "#declare Bark = rgb <0.4, 0.3, 0.2>;\nTransformation T_up { trans 0 0 1; }\n"
OAK = '#include "lib.plsys"\nSelection Oak { Oak -> T_up cylinder; }\nobject { Oak pigment { Bark } }\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "lib.plsys").write_text(LIBRARY)
    (tmp_path / "oak.plsys").write_text(OAK)
    (tmp_path / "ash.plsys").write_text(OAK.replace("Oak", "Ash"))
    hidden = tmp_path / ".git"
    hidden.mkdir()
    (hidden / "old.plsys").write_text("Selection Hidden { Hidden -> box; }\n")
    return tmp_path


def symbols(editor: Editor, query: str = "") -> list[str]:
    """Each symbol's name and place."""
    found = editor.request("workspace/symbol", {"query": query})
    return sorted(f"{each['name']} {editor.spot(each['location'])}" for each in found)


def test_symbols_of_files_that_are_not_open(folder):
    editor = Editor({"lib.plsys": LIBRARY}, folder=folder, roots=(folder,))
    assert symbols(editor, "a") == ["Ash ash.plsys:2:11 Ash", "Bark lib.plsys:1:10 Bark", "Oak oak.plsys:2:11 Oak"]
    assert symbols(editor, "hidden") == []


@pytest.mark.parametrize("encoding, character", [("utf-8", 28), ("utf-16", 26), ("utf-32", 25)])
def test_places_in_files_that_are_not_open(tmp_path, encoding, character):
    (tmp_path / "tree.plsys").write_text("/* \U0001f333 */        Selection Tree { Tree -> box; }\n")
    editor = Editor({"other.plsys": ""}, folder=tmp_path, roots=(tmp_path,), encoding=encoding)
    start = editor.request("workspace/symbol", {"query": "Tree"})[0]["location"]["range"]["start"]
    assert start == {"line": 0, "character": character}


def test_references_and_rename_reach_the_scenes_that_include_the_file(folder):
    editor = Editor({"lib.plsys": LIBRARY.replace("T_up", "T_<cursor>up")}, folder=folder, roots=(folder,))
    found = editor.at_cursor("textDocument/references", context={"includeDeclaration": True})
    spots = sorted(map(editor.spot, found))
    assert spots == ["ash.plsys:2:24 T_up", "lib.plsys:2:16 T_up", "oak.plsys:2:24 T_up"]
    edits = editor.at_cursor("textDocument/rename", newName="T_raise")["changes"]
    assert {uri.rpartition("/")[2]: len(each) for uri, each in edits.items()} == {
        "lib.plsys": 1, "ash.plsys": 1, "oak.plsys": 1,
    }  # fmt: skip


def test_rename_reaches_scenes_whose_library_is_not_open(folder):
    """Renaming from a scene: the library is edited on disk, and so are all others that include it, by whatever path."""
    below = folder / "more"
    below.mkdir()
    for i in range(12):
        (below / f"elm{i}.plsys").write_text(OAK.replace("Oak", "Elm").replace("lib", "../more/../lib"))
    editor = Editor({"oak.plsys": OAK.replace("T_up", "T_<cursor>up")}, folder=folder, roots=(folder,))
    edits = editor.at_cursor("textDocument/rename", newName="T_raise")["changes"]
    assert {uri.removeprefix(folder.as_uri()) for uri in edits} == {
        "/lib.plsys", "/ash.plsys", "/oak.plsys", *(f"/more/elm{i}.plsys" for i in range(12)),
    }  # fmt: skip
    with pytest.raises(Refusal, match="'Elm' is in this scene already"):
        editor.at_cursor("textDocument/rename", newName="Elm")


def test_a_path_with_dots_is_the_file_that_it_leads_to(tmp_path):
    (tmp_path / "lib.plsys").write_text(LIBRARY)
    (tmp_path / "sub").mkdir()
    scene = '#include "sub/../lib.plsys"\nobject { Oak }\nSelection Oak { Oak -> T_<cursor>up box; }\n'
    editor = Editor({"scene.plsys": scene}, folder=tmp_path)
    (place,) = editor.at_cursor("textDocument/definition")
    assert place["uri"] == (tmp_path / "lib.plsys").as_uri()
    (link,) = editor.in_file("textDocument/documentLink")
    assert link["target"] == (tmp_path / "lib.plsys").as_uri()


def test_a_library_is_looked_at_in_its_scenes(folder):
    alone = Editor({"lib.plsys": LIBRARY}, folder=folder)
    alone.check_whole("lib.plsys")
    assert "unused" in alone.codes("lib.plsys")
    among = Editor({"lib.plsys": LIBRARY}, folder=folder, roots=(folder,))
    among.check_whole("lib.plsys")
    assert "unused" not in among.codes("lib.plsys")


def test_files_come_and_go(folder):
    editor = Editor({"lib.plsys": LIBRARY}, folder=folder, roots=(folder,))

    def tell(name: str, kind: int) -> None:
        editor.notify("workspace/didChangeWatchedFiles", {"changes": [{"uri": (folder / name).as_uri(), "type": kind}]})

    (folder / "elm.plsys").write_text("Selection Elm { Elm -> box; }\n")
    tell("elm.plsys", 1)
    assert symbols(editor, "elm") == ["Elm elm.plsys:1:11 Elm"]
    (folder / "elm.plsys").write_text("\nSelection Elm2 { Elm2 -> box; }\n")
    tell("elm.plsys", 2)
    editor.texts.pop("elm.plsys", None)
    assert symbols(editor, "elm") == ["Elm2 elm.plsys:2:11 Elm2"]
    (folder / "elm.plsys").unlink()
    tell("elm.plsys", 3)
    assert symbols(editor, "elm") == []


def test_roots_come_and_go(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    (other / "yew.plsys").write_text("Selection Yew { Yew -> box; }\n")
    editor = Editor({"lib.plsys": LIBRARY}, folder=folder, roots=(folder,))
    assert editor.request("workspace/symbol", {"query": "yew"}) == []
    event = {"added": [{"uri": other.as_uri(), "name": "other"}], "removed": []}
    editor.notify("workspace/didChangeWorkspaceFolders", {"event": event})
    assert [each["name"] for each in editor.request("workspace/symbol", {"query": "yew"})] == ["Yew"]
    event = {"added": [], "removed": [{"uri": folder.as_uri(), "name": "folder"}]}
    editor.notify("workspace/didChangeWorkspaceFolders", {"event": event})
    found = [each["name"] for each in editor.request("workspace/symbol", {"query": ""})]
    assert sorted(found) == ["Bark", "T_up", "Yew"]  # lib.plsys is still open


def test_scenes_that_include_each_other(tmp_path):
    for name, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{name}.plsys").write_text(f'#include "{other}.plsys"\nSelection {name.upper()} {{ {name.upper()} -> box; }}\n')
    folders = Folders()
    folders.scan([tmp_path])
    assert folders.scenes_above(tmp_path / "a.plsys") == []
    text = (tmp_path / "a.plsys").read_text()
    editor = Editor({"a.plsys": text, "b.plsys": (tmp_path / "b.plsys").read_text()}, folder=tmp_path, roots=(tmp_path,))
    assert symbols(editor) == ["A a.plsys:2:11 A", "B b.plsys:2:11 B"]


def test_a_real_server_shows_how_far_it_is(folder):
    for i in range(30):
        (folder / f"long{i}.plsys").write_text("".join(f"Selection S{i}_{j} {{ S{i}_{j} -> box; }}\n" for j in range(400)))
    with Client() as client:
        root = {"uri": folder.as_uri(), "name": "scenes"}
        capabilities = {"window": {"workDoneProgress": True}}
        client.request("initialize", {"processId": None, "workspaceFolders": [root], "capabilities": capabilities})
        client.notify("initialized", {})
        created = client.wait(lambda message: message.get("method") == "window/workDoneProgress/create")
        client.send({"jsonrpc": "2.0", "id": created["id"], "result": None})
        values = []
        while not values or values[-1]["kind"] != "end":
            told = client.wait_for("$/progress")
            assert told["token"] == created["params"]["token"]
            values.append(told["value"])
        assert values[0]["kind"] == "begin" and values[0]["title"] == "Reading scenes"
        found = client.request("workspace/symbol", {"query": "S29_399"})["result"]
        assert [each["name"] for each in found] == ["S29_399"]


def test_a_client_without_progress_is_asked_nothing(folder):
    with Client() as client:
        client.request("initialize", {"processId": None, "rootUri": folder.as_uri(), "capabilities": {}})
        client.notify("initialized", {})
        while not client.request("workspace/symbol", {"query": "Oak"})["result"]:
            pass
        assert not [message for message in client.skipped if message.get("method") == "window/workDoneProgress/create"]
