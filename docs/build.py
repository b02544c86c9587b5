"""Helpers of the documentation's build: formulas as MathML and figures as SVG.

The pages then need no scripts, fonts or files from elsewhere.
"""

from __future__ import annotations

import html
import io
import re
from typing import Any

from latex2mathml.converter import convert

# The output of pymdownx.arithmatex in its generic mode: <span> for $...$, <div> for $$...$$.
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Returns the page with each formula as MathML; MkDocs calls this for each page."""
    return _FORMULA.sub(
        lambda match: convert(html.unescape(match[2]), display="inline" if match[1] == "span" else "block"), content
    )


def svg(axes: Any) -> str:
    """Returns the figure of matplotlib axes as an SVG element."""
    file = io.StringIO()
    axes.figure.savefig(file, format="svg", bbox_inches="tight")
    text = file.getvalue()
    return text[text.index("<svg") :]
