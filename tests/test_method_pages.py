"""The pages of the methods: their tables are those of the code, and their pictures and links are there."""

import re
from pathlib import Path

import pytest
from blocks import filled
from method_pages import parameters

from merge_cosim.controllers.base import controllers
from merge_cosim.core.registry import meanings
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars

ROOT = Path(__file__).parent.parent
PAGES = sorted((ROOT / "docs" / "methods").glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_parameters_are_those_of_the_code(page):
    text = page.read_text(encoding="utf-8")
    assert filled(text, {"parameters": parameters}) == text, "run python tools/method_pages.py"


def test_links_of_all_pages_lead_somewhere():
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\((?!http)([^)#]+)", page.read_text("utf-8"))]
    assert len(links) > 50
    assert [(page.name, link) for page, link in links if not (page.parent / link).exists()] == []


def test_a_stale_table_is_seen():
    stale = "<!-- parameters: estimator pgm -->\n| parameter | default |\n<!-- end -->"
    made = filled(stale, {"parameters": parameters})
    assert "| `pgm.nodes` | `52` | Number n of speed nodes;" in made
    assert filled(stale, {}) == stale


@pytest.mark.parametrize("name", [*estimators.names(), *controllers.names()])
def test_every_component_has_a_page_that_names_it(name):
    named = re.compile(rf"(?<![\w-]){name}(?![\w-])")
    assert any(named.search(page.read_text(encoding="utf-8")) for page in PAGES)


@pytest.mark.parametrize("registry", [estimators, controllers, merging_cars], ids=lambda registry: registry.role)
def test_every_parameter_is_explained(registry):
    for name in registry.names():
        assert all(meanings(registry[name]).values()), name
