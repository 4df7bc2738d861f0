"""Pages of one file: scripts become one, in which every import is found, and arrays come back as they were."""

import base64
import re
import zlib

import numpy as np

from twin.web import STATIC, PackedArrays, chart_script
from twin.web.embedding import CHART, EXPORT, IMPORT, VIEWS


def test_every_import_is_an_export_of_a_module_before(tmp_path):
    seen = {}
    for name in (*CHART, *VIEWS):
        text = (STATIC / name).read_text()
        assert len(IMPORT.findall(text)) == len(re.findall(r"^import ", text, re.MULTILINE)), name
        for names, module in IMPORT.findall(text):
            assert {one.strip() for one in names.strip("{} ").split(",")} <= seen[module], name
        seen[name.removesuffix(".js")] = {match[2] for match in EXPORT.finditer(text)}
    own = tmp_path / "own.js"
    own.write_text('// a comment\nimport { Chart } from "./chart.js";\n  // another\nnew Chart();\n')
    script = chart_script([own], views=True)
    assert not re.search(r"^(import|export) ", script, re.MULTILINE)
    assert script.endswith("const { Chart } = chart_module;\nnew Chart();\n")


def test_equal_arrays_are_stored_once():
    packed = PackedArrays()
    time, force = np.arange(5) / 10, [1.0, np.nan, 3.0]
    assert [packed.index(time), packed.index(force), packed.index(time.copy())] == [0, 1, 0]
    found = [np.frombuffer(zlib.decompress(base64.b64decode(text)), "<f8") for text in packed.texts]
    np.testing.assert_array_equal(found[0], time)
    np.testing.assert_array_equal(found[1], force)
