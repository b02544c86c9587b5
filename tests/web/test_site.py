"""What the site has and the repository does not: the page that plays, and the links to it."""

from types import SimpleNamespace

import pytest

pytest.importorskip("griffe", reason="the site needs the extra docs")
pytest.importorskip("mkdocs")

from mkdocs.exceptions import PluginError

from billiards_env.bench.frozen import FROZEN
from docs import build as site
from docs.web import build

PAGE = """\
<!-- site [Play](play.html) -->

[Look](../browser.md#game=free&dt=25), [read](../browser.md#limits), <a href="browser.md#game=given">cell</a>
"""


def test_links_open_the_shot_only_in_the_site():
    shown = site.on_page_markdown(PAGE, SimpleNamespace(file=SimpleNamespace(src_uri="study.md")))
    assert shown.splitlines() == [
        "[Play](play.html)",
        "",
        '[Look](../play.html#game=free&dt=25), [read](../browser.md#limits), <a href="play.html#game=given">cell</a>',
    ]


def test_the_site_needs_the_page_that_plays(monkeypatch):
    monkeypatch.setattr(site.File, "generated", lambda config, name, content: name)
    monkeypatch.setattr(build, "files", lambda: {"play.html": b"<!doctype html>"})
    files = []
    site.on_files(files, None)
    assert files == [*(f"tasks/{name}.md" for name in FROZEN), "play.html"]

    def fail():
        raise RuntimeError("ziglang is not installed")

    monkeypatch.setattr(build, "files", fail)
    with pytest.raises(PluginError, match=r"^play\.html: ziglang is not installed"):
        site.on_files([], None)
