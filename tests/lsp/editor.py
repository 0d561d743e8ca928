"""An editor without a screen: texts with `<cursor>` marks, and requests at the cursor.

Example::

    editor = Editor("object { Tr<cursor>ee }\\nSelection Tree { Tree -> box; }\\n")
    editor.at_cursor("textDocument/definition")     # the answer, as JSON
    editor.lines(answer)                            # ranges as text: ["Tree"]
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from plsys.compiler.analysis import check_whole
from plsys.lsp.session import Session

CURSOR = "<cursor>"


class Refusal(Exception):
    """The server answered with an error."""


class Editor:
    """``files`` is one text or several by name, written to ``folder`` where one is given; the (first) mark is the cursor.
    ``client`` are its capabilities, ``roots`` the folders that it has open."""

    def __init__(
        self, files: str | dict[str, str], folder: Path | None = None, client: dict | None = None, encoding: str = "utf-16",
        roots: tuple[Path, ...] = (),
    ) -> None:  # fmt: skip
        self.sent: list[dict] = []
        self.session = Session(self.sent.append)
        self._id = 0
        capabilities = {"general": {"positionEncodings": [encoding]}, **(client or {})}
        folders = [{"uri": root.as_uri(), "name": root.name} for root in roots]
        parameters = {"capabilities": capabilities, "workspaceFolders": folders}
        self.server = self.request("initialize", parameters)["capabilities"]
        self.notify("initialized", {})
        self.texts: dict[str, str] = {}
        self.cursor: dict[str, Any] | None = None
        files = {"scene.plsys": files} if isinstance(files, str) else files
        self.folder = folder
        cleaned = {}
        for name, marked in files.items():
            text = marked.replace(CURSOR, "", 1)
            if CURSOR in marked and self.cursor is None:
                self.cursor = {"textDocument": {"uri": self.uri(name)}, "position": position_of(text, marked.index(CURSOR))}
            cleaned[name] = text
            if folder is not None:
                (folder / name).write_bytes(text.encode())
        for name, text in cleaned.items():
            if folder is None or name == next(iter(cleaned)) or (self.cursor and self.uri(name) in str(self.cursor)):
                self.open(name, text)

    def uri(self, name: str) -> str:
        return (self.folder / name).as_uri() if self.folder is not None else f"untitled:{name}"

    # --- messages

    def request(self, method: str, params: dict | None = None) -> Any:
        """The result of a request. Raises Refusal with the server's message."""
        self._id += 1
        self.session.receive({"jsonrpc": "2.0", "id": self._id, "method": method, "params": params or {}})
        answer = next(m for m in reversed(self.sent) if m.get("id") == self._id)
        if "error" in answer:
            raise Refusal(answer["error"]["message"])
        return answer["result"]

    def notify(self, method: str, params: dict) -> None:
        self.session.receive({"jsonrpc": "2.0", "method": method, "params": params})

    def at_cursor(self, method: str, **more: Any) -> Any:
        assert self.cursor is not None, "the text has no <cursor>"
        return self.request(method, {**self.cursor, **more})

    def in_file(self, method: str, name: str = "scene.plsys", **more: Any) -> Any:
        return self.request(method, {"textDocument": {"uri": self.uri(name)}, **more})

    # --- texts

    def open(self, name: str, text: str) -> None:
        self.texts[name] = text
        document = {"uri": self.uri(name), "languageId": "plsys", "version": 1, "text": text}
        self.notify("textDocument/didOpen", {"textDocument": document})
        while self.session.workspace.is_opening:
            self.session.work()

    def change(self, old: str, new: str, name: str = "scene.plsys") -> None:
        """Replace the first ``old`` in a file."""
        text = self.texts[name]
        start = text.index(old)
        range_ = {"start": position_of(text, start), "end": position_of(text, start + len(old))}
        self.texts[name] = text[:start] + new + text[start + len(old) :]
        document = {"uri": self.uri(name), "version": 2}
        self.notify("textDocument/didChange", {"textDocument": document, "contentChanges": [{"range": range_, "text": new}]})

    def published(self, name: str = "scene.plsys") -> list[dict]:
        """The diagnostics that were last sent for a file."""
        while self.session.has_work:
            self.session.work()
        sent = [m["params"] for m in self.sent if m.get("method") == "textDocument/publishDiagnostics"]
        return next((p["diagnostics"] for p in reversed(sent) if p["uri"] == self.uri(name)), [])

    def checked(self, name: str = "scene.plsys") -> list[dict]:
        """As ``published``, after the whole-file checks."""
        document = self.session.workspace.document(self.uri(name))
        check_whole(self.session.workspace.scene(document))
        return self.session.workspace.diagnostics(document)

    def check_whole(self, name: str = "scene.plsys") -> None:
        """Run the whole-file checks, here and now."""
        workspace = self.session.workspace
        scene = workspace.scene(workspace.document(self.uri(name)))
        scene.work()
        check_whole(scene)

    def codes(self, name: str = "scene.plsys") -> list[str]:
        return [each["code"] for each in self.published(name)]

    def text_of(self, range_: dict, name: str = "scene.plsys") -> str:
        text = self.texts[name]
        return text[offset_of(text, range_["start"]) : offset_of(text, range_["end"])]

    def spot(self, location: dict) -> str:
        """``scene.plsys:2:10 Tree``: a Location's file, line and column from 1, and text."""
        name = location["uri"].rsplit("/", 1)[-1].removeprefix("untitled:")
        start = location["range"]["start"]
        if name not in self.texts and self.folder is not None:
            self.texts[name] = (self.folder / name).read_bytes().decode()
        return f"{name}:{start['line'] + 1}:{start['character'] + 1} {self.text_of(location['range'], name)}"


def position_of(text: str, index: int) -> dict:
    """The UTF-16 position of a character."""
    before = text[:index].replace("\r\n", "\n").replace("\r", "\n")
    line = before.rpartition("\n")[2]
    return {"line": before.count("\n"), "character": len(line.encode("utf-16-le")) // 2}


def offset_of(text: str, position: dict) -> int:
    lines = text.split("\n")
    line = lines[position["line"]].encode("utf-16-le")[: 2 * position["character"]].decode("utf-16-le")
    return sum(len(each) + 1 for each in lines[: position["line"]]) + len(line)
