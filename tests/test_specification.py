from __future__ import annotations

from typing import Optional

import pytest

from spoofgym.specification import Specification, build, spell, spell_changed


class Part:
    def __init__(
        self,
        size: float,
        count: int = 1,
        flag: bool = False,
        label: str | None = None,
        limit: Optional[float] = None,  # noqa: UP045 - the older spelling must be understood too
    ) -> None:
        self.arguments = (size, count, flag, label, limit)


class Bare:
    pass


def function(path: str, grade: str = "tactical") -> tuple[str, str]:
    return path, grade


REGISTRY = {"part": Part, "bare": Bare, "function": function}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("snapshot", Specification("snapshot")),
        (" snapshot ", Specification("snapshot")),
        ("ramp:0.5", Specification("ramp", "0.5")),
        ("ramp:0.5,direction=135", Specification("ramp", "0.5", {"direction": "135"})),
        ("ramp: 0.5 , direction = 135", Specification("ramp", "0.5", {"direction": "135"})),
        ("windowed:n=20,arl0=1e5", Specification("windowed", None, {"n": "20", "arl0": "1e5"})),
        ("windowed,n=20", Specification("windowed", None, {"n": "20"})),
        ("recorded:C:/logs/a", Specification("recorded", "C:/logs/a")),
        ("a,b=c:d", Specification("a", None, {"b": "c:d"})),
    ],
)
def test_parse_reads_name_value_and_options(text, expected):
    assert Specification.parse(text) == expected


@pytest.mark.parametrize("text", ["snapshot", "ramp:0.5", "ramp:0.5,direction=135", "windowed:n=20,arl0=1e5"])
def test_parse_and_str_are_inverse(text):
    assert str(Specification.parse(text)) == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected name"),
        ("   ", "expected name"),
        (":0.5", "expected name"),
        ("n=20", "expected name"),
        ("ramp:", "not key=value"),
        ("ramp:0.5,", "not key=value"),
        ("ramp:0.5,,direction=1", "not key=value"),
        ("ramp:0.5,135", "'135' is not key=value"),
        ("ramp,0.5", "'0.5' is not key=value"),
        ("ramp:0.5,direction=", "not key=value"),
        ("ramp:=0.5", "not key=value"),
        ("ramp:a=1,a=2", "'a' is given twice"),
    ],
)
def test_parse_refuses_what_is_not_a_specification(text, message):
    with pytest.raises(ValueError, match=message):
        Specification.parse(text)


def test_build_converts_by_annotation():
    part = build("part:2,count=3,flag=True,label=x,limit=1e5", REGISTRY, "part")
    assert part.arguments == (2.0, 3, True, "x", 1e5)
    assert [type(argument) for argument in part.arguments] == [float, int, bool, str, float]
    assert build("function:/tmp/log,grade=mems", REGISTRY, "part") == ("/tmp/log", "mems")
    assert isinstance(build("bare", REGISTRY, "part"), Bare)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "unknown part 'nothing'; valid names: bare, function, part"),
        ("part:1,colour=red", "no option 'colour'; valid options: size, count, flag, label, limit"),
        ("function:part:1,count=2", "valid options: path, grade; for an option of the part within, write '/' in place"),
        ("function:part,count=2", "valid options: path, grade$"),
        ("part", "needs 'size'"),
        ("part:1,size=2", "'size' is given twice"),
        ("part:one", "size must be a number, got 'one'"),
        ("part:1,count=1.5", "count must be a whole number, got '1.5'"),
        ("part:1,flag=yes", "flag must be true or false, got 'yes'"),
        ("part:1,limit=low", "limit must be a number, got 'low'"),
        ("bare:1", "takes no value"),
        ("bare:a=1", "valid options: none"),
    ],
)
def test_build_says_what_is_wrong_and_what_is_valid(text, message):
    with pytest.raises(ValueError, match=message):
        build(text, REGISTRY, "part")


@pytest.mark.parametrize("text", [None, 3, ["part"]])
def test_build_refuses_what_is_no_text(text):
    with pytest.raises(TypeError, match="part must be a specification"):
        build(text, REGISTRY, "part")


def test_spell_leaves_none_out_and_reads_back_exactly():
    assert spell("windowed", n=None, arl0=1e5) == "windowed:arl0=100000"
    assert spell("ramp", 0.5, direction=135.0, flag=True) == "ramp:0.5,direction=135,flag=true"
    assert spell("none") == "none"
    for number in (0.1 + 0.2, 1.0 / 3.0, 1e-5, 1e300, -2.5, 123456.789):
        assert float(Specification.parse(spell("x", number)).value) == number


def test_spell_changed_leaves_defaults_of_the_factory_out():
    given = {"size": 2.0, "count": 1, "flag": True, "label": None}
    assert spell_changed("part", Part, **given) == "part:size=2,flag=true"
    assert spell_changed("part", Part, **given | {"count": 3, "flag": False}) == "part:size=2,count=3"
