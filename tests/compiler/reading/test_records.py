"""Records: values by their fields, as dataclasses are, and printed like them."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, field, fields, replace

from plsys.compiler.reading.model import Constant, Read
from plsys.compiler.reading.records import record


@record
class Step:
    name: str
    size: float = 1.0
    place: int | None = field(default=None, compare=False)


@record(eq=False)
class Itself:
    name: str


@dataclass
class AsEver:
    name: str
    size: float = 1.0
    place: int | None = None


def test_records_are_equal_by_their_fields_and_class():
    assert Step("a", 2.0, place=3) == Step("a", 2.0, place=4) != Step("b", 2.0)
    assert len({Step("a", place=1), Step("a", place=2), Step("b")}) == 2
    assert Itself("a") != Itself("a") and len({Itself("a"), Itself("a")}) == 2
    assert Constant(1.0) != Read("1.0") and (Step("a") == "a") is False


def test_records_are_dataclasses():
    step = Step("a", 2.0, place=3)
    assert repr(step) == repr(AsEver("a", 2.0, 3)).replace("AsEver", "Step")
    assert [each.name for each in fields(step)] == ["name", "size", "place"]
    assert replace(step, name="b") == Step("b", 2.0)
    assert pickle.loads(pickle.dumps(step)) == step
    match step:
        case Step(name, size):
            assert (name, size) == ("a", 2.0)
