"""Components by name, with errors that name the nearest right one."""

import sys

import pytest

from twin.component import catalog
from twin.errors import DeclarationError

MODEL = '''
from twin.component import Component, output

class Spring(Component):
    """A spring."""
    y = output("", "y")

    def step(self, t, h):
        self.y = 1.0
'''


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with two components, one of them broken."""
    for name, text in (("spring", MODEL), ("broken", "from twin.component import Component\n")):
        folder = tmp_path / "fmus" / name
        folder.mkdir(parents=True)
        (folder / "model.py").write_text(text)
        (folder / "__init__.py").touch()
    (tmp_path / "fmus" / "__init__.py").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    modules = dict(sys.modules)
    for module in modules:
        if module.split(".")[0] == "fmus":
            del sys.modules[module]
    yield tmp_path
    sys.modules.clear()
    sys.modules.update(modules)


def test_names_and_components(project):
    assert {"broken", "spring"} < set(catalog.names())
    assert catalog.component("spring").__name__ == "Spring"
    assert catalog.component("fmus.spring.model:Spring") is catalog.component("spring")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("sprung", "Did you mean 'spring'"),
        ("broken", "found none"),
        ("fmus.spring.model:Sprang", "Did you mean 'Spring'"),
        ("fmus.nothing:Spring", "no module"),
    ],
)
def test_errors_name_what_is_right(project, name, reason):
    with pytest.raises(DeclarationError, match=reason):
        catalog.component(name)


def test_own_components_stand_beside_the_projects_without_an_init(project):
    (project / "fmus" / "__init__.py").unlink()
    assert {"spring", "heart"} < set(catalog.names())
    assert catalog.component("spring").__name__ == "Spring"
    assert catalog.component("heart").__name__ == "Heart"


def test_own_component_hides_the_projects_of_its_name(project):
    (project / "fmus" / "heart").mkdir()
    (project / "fmus" / "heart" / "model.py").write_text(MODEL)
    with pytest.raises(DeclarationError, match=r"is hidden by .*heart/model.py. Add an empty __init__.py"):
        catalog.component("heart")
    for module in ("fmus.heart.model", "fmus.heart"):
        del sys.modules[module]
    (project / "fmus" / "heart" / "__init__.py").touch()
    sys.path_importer_cache.clear()
    assert catalog.component("heart").__name__ == "Spring"


@pytest.mark.parametrize(
    ("text", "summary"),
    [
        ('"""A spring.\n\nAnd more."""\n', "A spring."),
        ("x = 1\n", ""),
        ('"""Cut off', ""),
        ("", ""),
    ],
)
def test_the_summary_of_a_component_is_the_first_line_of_its_file(text, summary, project):
    (project / "fmus" / "spring" / "model.py").write_text(text)
    assert catalog.summary("spring") == summary
    assert catalog.summary("nothing") == catalog.summary("no name") == ""
    (project / "fmus" / "spring" / "model.py").write_bytes(b"\xff\xfe\x00")
    assert catalog.summary("spring") == ""
    assert catalog.component_folder("spring") == project / "fmus" / "spring"
    assert catalog.component_folder("no name") is None


def test_outside_of_a_project_there_is_no_component(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(catalog, "fmus_folders", list)
    with pytest.raises(
        DeclarationError, match=r"There is no folder `fmus` in .*\. Run this from the project's folder\."
    ):
        catalog.names()
