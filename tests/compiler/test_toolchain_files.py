"""What is kept of what clang and the linkers made, by many at once, and what they say to mistakes."""

import os
import subprocess
import sys
import threading

import pytest

from tests.compiler.test_toolchain import FRICTION, ON_LINUX, SYMBOLS, elf
from twin.compiler import toolchain, zig
from twin.compiler.toolchain import BARE, PLATFORMS, archive, compile_c, host, link, load, side_by_side
from twin.errors import BuildError
from twin.store import LOCK, make_key


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", [*PLATFORMS, *BARE])
def test_bytes_do_not_depend_on_where_and_by_whom(target, tmp_path, monkeypatch):
    def made(build):
        code = compile_c(FRICTION, target, build)
        return code, (link(target, [code], build) if target in PLATFORMS else archive(target, {"component.o": code}))

    first = made(tmp_path / "one")
    (tmp_path / "poison").mkdir()
    (tmp_path / "poison" / "stdint.h").write_text("#error the environment decides\n")
    monkeypatch.setenv("CPATH", str(tmp_path / "poison"))
    monkeypatch.setenv("HOME", "/nowhere")
    monkeypatch.chdir(tmp_path)
    assert made((tmp_path / "two").relative_to(tmp_path)) == first
    assert str(tmp_path).encode() not in b"".join(first)


def test_what_is_kept_is_not_made_again(tmp_path, monkeypatch):
    code = compile_c(FRICTION, host(), tmp_path)
    addresses = load("friction", [code], tmp_path, SYMBOLS)
    monkeypatch.setattr(zig, "make", None)
    assert compile_c(FRICTION, host(), tmp_path) == code
    assert load("friction", [code], tmp_path, SYMBOLS) == addresses
    for changed in ({"headers": {"a.h": ""}}, {"options": ("-O1",)}, {"name": "other.c"}):
        with pytest.raises(TypeError):
            compile_c(FRICTION, host(), tmp_path, **changed)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("int x;\nint y = z;\nint w = v;\n", "heart.c:2: use of undeclared identifier 'z'"),
        ('#include "no.h"\n', "heart.c:1: 'no.h' file not found"),
        ('#include "sub.h"\n', "sub.h:1: unknown type name 'wrong'"),
        ("double f(double x) { return sin(x); }\n", "heart.c:1: call to undeclared library function 'sin'"),
        (
            '_Static_assert(1 == 2, "layout");\n',
            "heart.c:1: static assertion failed due to requirement '1 == 2': layout",
        ),
    ],
)
def test_errors_are_one_line_with_their_place(text, message, tmp_path):
    with pytest.raises(BuildError) as caught:
        compile_c(text, "aarch64-linux", tmp_path, headers={"sub.h": "wrong x;\n"}, name="heart.c")
    assert str(caught.value).startswith(f"aarch64-linux: {message}")
    assert "\n" not in str(caught.value)


def test_unknown_platforms(tmp_path):
    with pytest.raises(BuildError, match=r"platform 'amiga' is not known. Use one of x86_64-linux, .*cortex-a53"):
        compile_c("", "amiga", tmp_path)
    with pytest.raises(BuildError, match="platform 'cortex-m7' has no shared libraries"):
        link("cortex-m7", [], tmp_path)


@pytest.mark.parametrize("target", BARE)
def test_archives_hold_what_they_are_given(target, tmp_path):
    code = compile_c(FRICTION, target, tmp_path)
    data = archive(target, {"component.o": code, "shell.o": compile_c("int one(void) { return 1; }", target, tmp_path)})
    assert data.startswith(b"!<arch>\n")
    assert code in data
    assert data.index(b"component.o/") < data.index(b"shell.o/")
    machine = {"cortex-m7": "EM_ARM", "cortex-a53": "EM_AARCH64"}[target]
    assert elf(code)["e_machine"] == machine


@pytest.mark.slow
@ON_LINUX
def test_many_at_once_into_one_folder(tmp_path):
    """Threads and processes that make the same things at the same time get the same, and leave nothing behind."""
    script = (
        "import sys; from pathlib import Path; from tests.compiler import test_toolchain_files as t\n"
        "code = t.compile_c(t.FRICTION, t.host(), Path(sys.argv[1]))\n"
        "t.load('friction', [code], Path(sys.argv[1]), t.SYMBOLS); print(t.made(code, Path(sys.argv[1])))"
    )
    processes = [
        subprocess.Popen([sys.executable, "-c", script, str(tmp_path)], stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]

    def one():
        code = compile_c(FRICTION, host(), tmp_path)
        load("friction", [code], tmp_path, SYMBOLS)
        return made(code, tmp_path)

    found = {*side_by_side([one] * 8), *(process.communicate()[0].strip() for process in processes)}
    assert len(found) == 1
    assert [path.name for path in tmp_path.rglob(".*")] == [LOCK]


def made(code, build):
    """Hash of an object file and of the library that was loaded."""
    (library,) = build.glob("cache/friction-*/library.*")
    return make_key(code, library.read_bytes())


def test_side_by_side_keeps_the_order():
    assert side_by_side([]) == []
    assert side_by_side(lambda k=k: k for k in range(20)) == list(range(20))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    meeting = threading.Barrier(cores, timeout=20.0)
    assert len(side_by_side([meeting.wait] * cores)) == cores

    def fails():
        raise BuildError("second")

    with pytest.raises(BuildError, match="second"):
        side_by_side([lambda: 1, fails])


def test_a_missing_compiler_is_told(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(BuildError, match="pip install ziglang"):
        zig.executable.__wrapped__()


def test_every_target_has_its_row():
    assert list(PLATFORMS) == ["x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin"]
    assert not [option for row in [*PLATFORMS.values(), *BARE.values()] for option in row.options if "native" in option]
    assert "-ffast-math" not in toolchain.OPTIONS
