"""Libraries compiled of other tools' sources: their options reach no file or program outside."""

import pytest

from tests.every_case import every_case
from twin.compiler.hosted import ALLOWED, build_hosted_library, private_cache
from twin.errors import BuildError
from twin.store import Store

HARMLESS = ("-DX=1", "-O2", "-std=c11", "-Wall", "-Iinclude", "-ffp-contract=off", "-fno-builtin", "-lm", "-mavx2")
HARMFUL = (
    "-fplugin=x.so",
    "@file",
    "-B/tmp",
    "-MF/tmp/x",
    "-o/tmp/x",
    "-Wl,-rpath,/tmp",
    "-I/etc",
    "-Ia/../..",
    "-include/etc/passwd",
)


@every_case("option", HARMLESS)
def test_usual_options_are_allowed(option):
    assert ALLOWED.fullmatch(option)


@pytest.mark.parametrize("option", HARMFUL)
def test_options_that_reach_outside_are_refused(option, tmp_path):
    with pytest.raises(BuildError, match="is not allowed"):
        build_hosted_library("x", {"a.c": b"int x;"}, ["a.c"], [option], tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_cache_of_the_c_library_is_of_this_user_alone(tmp_path):
    folder = private_cache(tmp_path)
    assert folder is not None
    assert folder == private_cache(tmp_path)
    assert Store(tmp_path).entries()[0][2] == folder  # so that `twin cache clear` removes it
    folder.chmod(0o775)
    assert private_cache(tmp_path) is None
