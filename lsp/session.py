"""One client's session: messages in, messages out, without a transport.

``receive`` takes the protocol's messages as plain JSON and answers through ``send``. Text notifications change the
documents at once; what follows from them (updates.py) is done by ``work``, when no message waits, so that the latest
edit wins.

Example::

    session = Session(send=print)
    session.receive({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}})
    # prints {"jsonrpc": "2.0", "id": 1, "result": {"capabilities": …}}
"""

from __future__ import annotations

import logging
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Callable

from plsys.compiler.analysis import Folders, prepare_messages

from . import features
from .progress import Progress
from .request import Feature, Request
from .text import ENCODINGS
from .updates import Updates
from .workspace import UnknownDocument, Workspace

logger = logging.getLogger(__name__)

PARSE_ERROR, INVALID_REQUEST, METHOD_NOT_FOUND, INVALID_PARAMS, INTERNAL_ERROR = -32700, -32600, -32601, -32602, -32603
NOT_INITIALIZED, REQUEST_CANCELLED, CONTENT_MODIFIED = -32002, -32800, -32801

# What is answered while a long file is being opened, as far as it is known; other requests wait until all of it is read.
EARLY = frozenset((
    "textDocument/completion", "textDocument/hover", "textDocument/onTypeFormatting", "textDocument/rangeFormatting",
    "textDocument/selectionRange", "textDocument/semanticTokens/range", "textDocument/signatureHelp",
))  # fmt: skip

# Files whose changes on disk matter: scenes, and the meshes that they use.
WATCHED = ("**/*.plsys", "**/*.obj", "**/*.ply")


class Refused(Exception):
    """Raised by a feature to answer with an error: a code of the protocol and a message for people."""

    def __init__(self, message: str, code: int = INVALID_PARAMS) -> None:
        super().__init__(message)
        self.code = code


def load_features() -> dict[str, Feature]:
    """The rows of all modules in features/, by method."""
    found: dict[str, Feature] = {}
    for module in sorted(each.name for each in iter_modules(features.__path__)):
        for feature in import_module(f"{features.__name__}.{module}").FEATURES:
            if feature.method in found:
                raise ValueError(f"{feature.method} is answered twice")
            found[feature.method] = feature
    return found


class Session(Updates):
    """``send`` takes a message to the client. ``exit_code`` is None until the client ended the session. ``wake`` and
    ``is_message_waiting``: see Updates."""

    def __init__(
        self, send: Callable[[dict], None], wake: Callable[[], None] | None = None,
        is_message_waiting: Callable[[], bool] = lambda: False,
    ) -> None:  # fmt: skip
        super().__init__(wake, is_message_waiting)
        self._send = send
        self.features = load_features()
        self.exit_code: int | None = None
        self._initialized = self._shut_down = False
        self._waiting: list[dict] = []  # requests about files that are being opened
        self._shown_early = False  # semantic tokens were sent without knowing all names
        self._next_id = 0
        self._asked: dict[str, Callable[[dict], None]] = {}  # requests of ours that wait for an answer
        self._notifications: dict[str, Callable[[dict], None]] = {
            "textDocument/didOpen": self._did_open,
            "textDocument/didChange": self._did_change,
            "textDocument/didClose": self._did_close,
            "workspace/didChangeWatchedFiles": self._did_change_watched_files,
            "workspace/didChangeWorkspaceFolders": self._did_change_folders,
            "initialized": self._on_initialized,
            "exit": self._exit,
        }

    # --- messages

    def receive(self, message: Any) -> None:
        """Take one message. Never raises for what it holds."""
        if not isinstance(message, dict) or not isinstance(message.get("method", ""), str):
            self._refuse(None, INVALID_REQUEST, "a message is an object with a method")
            return
        method, number = message.get("method"), message.get("id")
        if method is None:
            then = self._asked.pop(number, None) if isinstance(number, str) else None
            if then is not None:
                then(message)
            return
        params = message.get("params")
        if number is not None:
            params = params if isinstance(params, dict) else {}
            if self._must_wait(method):
                self._waiting.append(message)
            else:
                self._request(number, method, params)
        elif method in self._notifications and (self._initialized or method == "exit"):
            try:
                self._notifications[method](params if isinstance(params, dict) else {})
            except Exception:
                logger.exception("%s failed", method)

    def _must_wait(self, method: str) -> bool:
        """Whether an answer needs files that are still being read."""
        if method not in self.features or self._shut_down:
            return False
        if method == "textDocument/rename" and self.workspace.scans.is_reading:
            return True  # it must not miss a file
        if not self.workspace.is_opening:
            return False
        self._shown_early |= method.startswith("textDocument/semanticTokens")
        return method not in EARLY

    def cancel(self, number: Any) -> None:
        """Drop a request that waits for a file to be opened."""
        for message in [each for each in self._waiting if each["id"] == number]:
            self._waiting.remove(message)
            self.refuse_cancelled(number)

    def work(self) -> None:
        """Do for a moment what follows from edits. Call it until ``has_work`` is false."""
        if self.update() and (self._waiting or self._shown_early) and not self.workspace.is_opening:
            self._answer_waiting()

    def _answer_waiting(self) -> None:
        waiting, self._waiting = self._waiting, []
        for message in waiting:
            self.receive(message)  # may wait again
        if self._shown_early:
            self._refresh("semanticTokens", "semanticTokens")
        self._shown_early = False

    def _request(self, number: Any, method: str, params: dict) -> None:
        if method == "initialize":
            self._answer(number, self._initialize, params)
        elif not self._initialized:
            self._refuse(number, NOT_INITIALIZED, "the first request is initialize")
        elif self._shut_down:
            self._refuse(number, INVALID_REQUEST, "the session was shut down")
        elif method == "shutdown":
            self._shut_down = True
            self._reply(number, None)
        elif (feature := self.features.get(method)) is not None:
            self._answer(number, lambda given: feature.answer(Request(self.workspace, given, self.client)), params)
        else:
            self._refuse(number, METHOD_NOT_FOUND, f"no such method: {method}")

    def _answer(self, number: Any, answer: Callable[[dict], Any], params: dict) -> None:
        try:
            result = answer(params)
        except Refused as error:
            self._refuse(number, error.code, str(error))
        except UnknownDocument as error:
            self._refuse(number, INVALID_PARAMS, f"no such document: {error}")
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            logger.exception("a request failed")
            self._refuse(number, INVALID_PARAMS, f"the request can't be answered: {error!r}")
        except Exception as error:
            logger.exception("a request failed")
            self._refuse(number, INTERNAL_ERROR, f"the request failed: {error!r}")
        else:
            self._reply(number, result)

    def _reply(self, number: Any, result: Any) -> None:
        self._send({"jsonrpc": "2.0", "id": number, "result": result})

    def _refuse(self, number: Any, code: int, message: str) -> None:
        self._send({"jsonrpc": "2.0", "id": number, "error": {"code": code, "message": message}})

    def refuse_unreadable(self) -> None:
        """Answer bytes that are no JSON."""
        self._refuse(None, PARSE_ERROR, "a message is JSON")

    def refuse_cancelled(self, number: Any) -> None:
        self._refuse(number, REQUEST_CANCELLED, "cancelled")

    def notify(self, method: str, params: Any) -> None:
        self._send({"jsonrpc": "2.0", "method": method, "params": params})

    def ask(self, method: str, params: Any = None, then: Callable[[dict], None] | None = None) -> None:
        """Send the client a request; ``then`` gets the answer's message."""
        self._next_id += 1
        number = f"plsys-{self._next_id}"
        if then is not None:
            self._asked[number] = then
        self._send({"jsonrpc": "2.0", "id": number, "method": method, "params": params})

    # --- the session's life

    def _initialize(self, params: dict) -> dict:
        capabilities = params.get("capabilities")
        self.client = capabilities if isinstance(capabilities, dict) else {}
        offered = (self.client.get("general") or {}).get("positionEncodings") or ["utf-16"]
        encoding = next((each for each in ENCODINGS if each in offered), "utf-16")
        scans = Folders(lambda found: self._later(self._take_found, found)) if self._wake is not None else None
        self.workspace = Workspace(encoding, scans)
        self.progress = Progress(self.ask, self.notify, self.client)
        for folder in params.get("workspaceFolders") or []:
            self.workspace.add_folder(folder["uri"])
        if not self.workspace.folders and params.get("rootUri"):
            self.workspace.add_folder(params["rootUri"])
        self._initialized = True
        return {"capabilities": self.capabilities(encoding), "serverInfo": {"name": "plsys"}}

    def capabilities(self, encoding: str) -> dict:
        result: dict[str, Any] = {
            "positionEncoding": encoding,
            "textDocumentSync": {"openClose": True, "change": 2, "save": False},
            "workspace": {"workspaceFolders": {"supported": True, "changeNotifications": True}},
        }
        for feature in self.features.values():
            if feature.capability:
                *path, key = feature.capability.split(".")
                target = result
                for part in path:
                    target = target.setdefault(part, {})
                if isinstance(target.get(key), dict) and isinstance(feature.options, dict):
                    target[key] = {**target[key], **feature.options}
                else:
                    target[key] = feature.options
        return result

    def _on_initialized(self, params: dict) -> None:
        dynamic = ((self.client.get("workspace") or {}).get("didChangeWatchedFiles") or {}).get("dynamicRegistration")
        if dynamic:
            watchers = [{"globPattern": pattern} for pattern in WATCHED]
            registration = {"id": "watch", "method": "workspace/didChangeWatchedFiles",
                            "registerOptions": {"watchers": watchers}}
            self.ask("client/registerCapability", {"registrations": [registration]})
        self.workspace.scans.scan(self.workspace.folders.values())
        if self._checker is not None:
            self._checker.prepare()
        prepare_messages()

    def _exit(self, params: dict) -> None:
        self.exit_code = 0 if self._shut_down else 1

    def close(self) -> None:
        """Let go of what the session holds outside of this process."""
        if self._checker is not None:
            self._checker.close()
        self.workspace.scans.close()

    # --- texts

    def _did_open(self, params: dict) -> None:
        given = params["textDocument"]
        self._opened(self.workspace.did_open(given["uri"], given["text"], given["version"]))

    def _did_change(self, params: dict) -> None:
        given = params["textDocument"]
        for message in [each for each in self._waiting if _uri(each) == given["uri"]]:
            self._waiting.remove(message)
            self._refuse(message["id"], CONTENT_MODIFIED, "the text has changed")
        document = self.workspace.did_change(given["uri"], given["version"], params["contentChanges"])
        if document is not None:
            self._edited(document)

    def _did_close(self, params: dict) -> None:
        uri = params["textDocument"]["uri"]
        document = self.workspace.did_close(uri)
        self._closed(document, uri)

    def _did_change_watched_files(self, params: dict) -> None:
        self.workspace.files_changed([change["uri"] for change in params["changes"]])
        self._touch_all()

    def _did_change_folders(self, params: dict) -> None:
        for folder in params["event"].get("removed", ()):
            self.workspace.remove_folder(folder["uri"])
        added = [self.workspace.add_folder(folder["uri"]) for folder in params["event"].get("added", ())]
        self.workspace.scans.scan(path for path in added if path is not None)
        self._touch_all()


def _uri(message: dict) -> str | None:
    params = message.get("params")
    document = params.get("textDocument") if isinstance(params, dict) else None
    return document.get("uri") if isinstance(document, dict) else None
