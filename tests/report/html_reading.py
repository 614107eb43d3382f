"""Reading a page as a browser would, with the standard library's parser, to judge what is in it."""

from __future__ import annotations

import re
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "hr", "link", "input", "wbr"}
FORBIDDEN = {
    *("script", "iframe", "object", "embed", "base", "form", "link", "foreignobject", "animate", "set"),
    *("audio", "video", "source", "template"),
}


class PageText(HTMLParser):
    """All tags with their attributes, the text outside of style, and whether tags close in order."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.styles: list[str] = []
        self.comments: list[str] = []
        self.open: list[str] = []
        self.faults: list[str] = []
        self.feed(html)
        self.close()
        self.faults += [f"{tag} is never closed" for tag in self.open]

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if tag in VOID:
            return
        if not self.open or self.open[-1] != tag:
            self.faults.append(f"</{tag}> closes {self.open[-1:] or 'nothing'}")
        else:
            self.open.pop()

    def handle_data(self, data):
        if self.words and self.tags[-1][0] == "wbr":
            # A place where a word may be broken, and no end of it.
            self.words[-1] += data
        else:
            (self.styles if self.open[-1:] == ["style"] else self.words).append(data)

    def handle_comment(self, data):
        self.comments.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def dangers(page: PageText) -> list[str]:
    """Return everything that a self-contained, inert page must not have."""
    found = [f"element {tag}" for tag, _ in page.tags if tag in FORBIDDEN]
    for tag, attributes in page.tags:
        for name, value in attributes.items():
            value = value or ""
            if name.startswith("on"):
                found.append(f"handler {name} on {tag}")
            if name in (
                "href",
                "src",
                "xlink:href",
                "action",
                "srcset",
                "data",
                "formaction",
                "poster",
            ) and not (value.startswith("#") or value.startswith("data:image/png;base64,")):
                found.append(f"{tag} {name}={value[:60]}")
            if name not in ("alt", "aria-label") and re.search(r"https?:|javascript:|url\((?!#)", value):
                found.append(f"{tag} {name}={value[:60]}")
    for sheet in page.styles:
        found += re.findall(r"@import|url\(|https?:|expression\(", sheet)
    return found + page.comments


def broken_references(page: PageText) -> list[str]:
    """Return ids that occur twice, and references to ids that are not there."""
    ids = [a["id"] for _, a in page.tags if a.get("id")]
    found = [f"{i} twice" for i in set(ids) if ids.count(i) > 1]
    for _, attributes in page.tags:
        for name, value in attributes.items():
            value = value or ""
            wanted = re.findall(r"url\(#([^)]+)\)", value) + (
                [value[1:]] if name == "href" and value[:1] == "#" else []
            )
            found += [f"{name} to {w}" for w in wanted if w not in ids]
    return found
