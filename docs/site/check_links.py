"""Checks the links of a folder of static pages: python3 docs/site/check_links.py FOLDER

Every link between files leads to a file of the folder, every anchor to an element of its page, and index.html leads to every page.
Nothing is asked of another host: images, scripts, styles and frames lie in the folder; only a link that is clicked may lead
outside. What scripts ask for is not seen here: .ci/browser sees it. Planted defects are tried first; each must be found.
"""

from __future__ import annotations

import re
import sys
import tempfile
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Attributes whose value a browser follows, at once or on a click.
FOLLOWED = {"href", "xlink:href", "src", "srcset", "data", "poster", "background", "action", "formaction", "manifest"}
IN_STYLE = re.compile(r"""url\(\s*["']?([^"')]+)|@import\s+["']([^"']+)""")


class Page(HTMLParser):
    """The anchors of a page, its links, and those among them that wait for a click."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors, self.targets, self.clicked = {"", "top"}, set[str](), set[str]()
        self.in_style = path.suffix == ".css"
        text = path.read_text(encoding="utf-8")
        if self.in_style:
            self.handle_data(text)
        else:
            self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.in_style = tag == "style"
        for name, value in attrs:
            value = value or ""
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value)
            elif name == "style":
                self.targets |= in_style(value)
            elif tag == "meta" and name == "content" and "url=" in value.lower():
                self.targets.add(re.split("url=", value, flags=re.IGNORECASE)[1])
            elif tag in ("a", "area") and name in ("href", "xlink:href"):
                self.clicked.add(value)
            elif name == "srcset":
                self.targets |= {part.split()[0] for part in value.split(",") if part.strip()}
            elif name in FOLLOWED:
                self.targets.add(value)

    def handle_endtag(self, tag: str) -> None:
        self.in_style = False

    def handle_data(self, data: str) -> None:
        if self.in_style:
            self.targets |= in_style(data)


def in_style(text: str) -> set[str]:
    return {(url or imported).strip() for url, imported in IN_STYLE.findall(text)}


def check(folder: Path) -> tuple[list[str], str]:
    """The defects, and what was checked in one line."""
    folder = folder.resolve()
    files = sorted(path for path in folder.rglob("*") if path.suffix in (".html", ".svg", ".css"))
    pages = {path: Page(path) for path in files}
    leads_to: dict[Path, set[Path]] = {path: set() for path in files}
    wrong, followed, anchors, outside = [], 0, 0, 0
    for path, page in pages.items():
        for target in sorted(page.targets | page.clicked):
            place = f"{path.relative_to(folder)}: `{target}`"
            url = urlsplit(target)
            if url.scheme in ("data", "mailto"):
                continue
            if url.scheme or url.netloc:
                outside += 1
                if target not in page.clicked or target in page.targets:
                    wrong.append(f"{place} is asked of another host")
                elif url.scheme != "https":
                    wrong.append(f"{place} is no https address")
                continue
            followed += 1
            file = (path.parent / unquote(url.path)).resolve() if url.path else path
            if url.path.startswith("/") or not file.is_relative_to(folder):
                wrong.append(f"{place} leads out of the folder")
            elif not file.is_file():
                wrong.append(f"{place} leads to no file")
            elif file in pages:
                leads_to[path].add(file)
                anchors += bool(url.fragment)
                if unquote(url.fragment) not in pages[file].anchors:
                    wrong.append(f"{place} leads to no element")
    reached, todo = set[Path](), [folder / "index.html"]
    while todo:
        at = todo.pop()
        if at in pages and at not in reached:
            reached.add(at)
            todo += leads_to[at]
    html = [path for path in files if path.suffix == ".html"]
    wrong += [f"{path.relative_to(folder)}: no way from index.html leads here" for path in html if path not in reached]
    return wrong, f"{len(html)} pages, {followed} links in the folder, {anchors} of them to an anchor, {outside} to elsewhere"


# A page's content and what is to be found in it.
PLANTED = {
    '<a href="gone.html">': "leads to no file",
    '<a href="other.html#gone">': "leads to no element",
    '<a href="#gone">': "leads to no element",
    '<a href="../outside.html">': "leads out of the folder",
    '<a href="/index.html">': "leads out of the folder",
    '<a href="http://example.org">': "is no https address",
    '<img src="https://example.org/x.png">': "is asked of another host",
    '<img src="gone.png">': "leads to no file",
    '<img srcset="//example.org/x.png 2x">': "is asked of another host",
    '<link rel="stylesheet" href="//example.org/x.css">': "is asked of another host",
    '<script src="https://example.org/x.js"></script>': "is asked of another host",
    "<style>p { background: url(https://example.org/x.png) }</style>": "is asked of another host",
    '<style>@import "gone.css";</style>': "leads to no file",
    '<p style="background: url(gone.png)">': "leads to no file",
    '<meta http-equiv="refresh" content="0; url=gone.html">': "leads to no file",
}
SOUND = '<a href="other.html#there">, <a href="#top">, <a href="https://example.org">, <img src="data:,">, <p id="here">'


def try_planted() -> None:
    """Ends with an error if a planted defect is not found, or one is found where there is none."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name, "pages")
        folder.mkdir()
        Path(name, "outside.html").touch()
        (folder / "other.html").write_text('<a href="index.html#here"><p id="there">')
        for content, expected in {SOUND: "", **PLANTED}.items():
            (folder / "index.html").write_text(SOUND + content)
            found = check(folder)[0]
            if [defect.split("` ")[1] for defect in found] != ([expected] if expected else []):
                sys.exit(f"planted: {content}, found: {found}")
        (folder / "alone.html").touch()
        (folder / "index.html").write_text(SOUND)
        if check(folder)[0] != ["alone.html: no way from index.html leads here"]:
            sys.exit("a page without a way to it was not found")


if __name__ == "__main__":
    try_planted()
    defects, checked = check(Path(sys.argv[1]))
    print("\n".join([*defects, checked]))
    sys.exit(bool(defects))
