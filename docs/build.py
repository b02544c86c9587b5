"""Helpers of the documentation's build, which make pages that need no network."""

from __future__ import annotations

import base64
import html
import io
import re
import subprocess
from typing import Any

import griffe
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

from billiards_env.bench.frozen import FROZEN, NAMESPACE
from billiards_env.drawing.style import TEXT
from docs.web import build
from studies import live_shot
from studies.frozen_tasks import page as task_page

_EM = 8.5  # points; smaller than the font size of 10, as the letters of Computer Modern are small
# The output of pymdownx.arithmatex in its generic mode: <span> for $...$, <div> for $$...$$.
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
_SHOWN = re.compile(r'^(```python exec="true"[^\n]*) show="([^"]+)"\n(.*?)^```$', re.MULTILINE | re.DOTALL)
_SITE = re.compile(r"<!-- site (.*?) -->")


def formula(tex: str) -> str:
    """Returns a formula as an image that matplotlib draws; its size follows the size of the text."""
    text = f"${' '.join(tex.split())}$"
    with rc_context({"mathtext.fontset": "cm", "font.size": 10}):
        width, height, depth, _, _ = MathTextParser("path").parse(text, dpi=72)
        width, height, depth = width + 1, height + 2, depth + 1  # room for the edges of the letters
        figure = Figure(figsize=(width / 72, height / 72))
        figure.text(0.5 / width, depth / height, text)
        data = base64.b64encode(_svg(figure).encode()).decode()
    style = f"height: {height / _EM:.3f}em; vertical-align: {-depth / _EM:.3f}em"
    return f'<img class="formula" alt="{html.escape(tex)}" style="{style}" src="data:image/svg+xml;base64,{data}">'


def on_files(files: Any, config: Any) -> None:
    """Adds a page for each frozen task and the files of `docs.web.build`; MkDocs calls this once."""
    for name in FROZEN:
        files.append(File.generated(config, f"tasks/{name}.md", content=task_page(name)))
    try:
        made = build.files()
    except (RuntimeError, subprocess.CalledProcessError) as error:
        raise PluginError(f"play.html: {error}") from error
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))


def show(value: Any) -> str:
    """Returns HTML: the picture of matplotlib axes, the output of a notebook for a shot, or a string unchanged."""
    if isinstance(value, str):
        return value
    return _svg(value.figure, bbox_inches="tight") if hasattr(value, "figure") else value._repr_html_()


def live(scene: Any, positions: Any, velocity: Any, steps: int) -> str:
    """Returns the page that plays a shot with both engines, for a tutorial. See `studies.live_shot`."""
    address = f"../play.html{live_shot(scene, positions, velocity, steps)}"
    return f'<iframe class="live" src="{address}" title="A shot"></iframe>'


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Adds what a page needs only in the site; MkDocs calls this for each page.

    A block of code with the option `show="..."` is followed by the picture of this expression. The content of a comment
    `<!-- site ... -->` is shown. A link to `browser.md#game=...` becomes one to the shot in `play.html`, which is
    not in the repository. The ids in the table of frozen tasks link to their pages.
    """
    lines = (
        r"\1",
        r"\3from docs.build import live, show  # markdown-exec: hide",
        r"print(show(\2))  # markdown-exec: hide",
        "```",
    )
    hidden = "\n".join(lines)
    markdown = _SITE.sub(r"\1", _SHOWN.sub(hidden, markdown)).replace("browser.md#game=", "play.html#game=")
    if page.file.src_uri != "tasks.md":
        return markdown
    row = re.compile(rf"^\| (`{NAMESPACE}(\S+)`)", re.MULTILINE)
    return row.sub(r"| [\1](tasks/\2.md)", markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Returns the page with its formulas as images; MkDocs calls this for each page."""

    def image(match: re.Match[str]) -> str:
        drawn = formula(html.unescape(match[2]))
        return drawn if match[1] == "span" else f'<p class="formula">{drawn}</p>'

    return _FORMULA.sub(image, content)


class Examples(griffe.Extension):
    """Reads the section "Example:" of a docstring as the section "Examples:", which mkdocstrings formats as code."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Changes the docstring of an object."""
        if obj.docstring:
            obj.docstring.value = re.sub(r"^Example:$", "Examples:", obj.docstring.value, flags=re.MULTILINE)


def _svg(figure: Figure, **options: Any) -> str:
    file = io.StringIO()
    figure.savefig(file, format="svg", transparent=True, **options)
    text = file.getvalue()
    return text[text.index("<svg") :].replace(TEXT, "currentcolor")  # the colour of the page's text
