"""Links between pages of the book, files of the tree and what `make docs` builds beside the book."""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: Pages at the root of the tree that are chapters, too, and the names of their chapters.
ROOT_PAGES = {
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
}
LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def rewritten(text, page, root):
    """The text of a page with links that work in the book; a file of the tree without a page becomes its name."""
    docs, built = root / "docs", root / "target/doc"

    def link(match):
        words, target = match.groups()
        place, _, anchor = target.partition("#")
        if re.match(r"[a-z]+:", target) or not place:
            return match[0]
        file = Path(*_parts(page.parent / place))
        anchor = f"#{anchor}" if anchor else ""
        if file.is_relative_to(built / "book"):
            return f"[{words}]({file.stem}.md{anchor})"
        if file.is_relative_to(built):
            return f'<a href="../{file.relative_to(built).as_posix()}{anchor}">{_inline(words)}</a>'
        if not file.exists():
            raise SystemExit(f"error: {page.relative_to(root)} links to {target}, which is not there")
        if file.parent == docs:
            return f"[{words}]({file.name}{anchor})"
        if file.parent == root and file.name in ROOT_PAGES:
            return f"[{words}]({ROOT_PAGES[file.name]}{anchor})"
        name = file.relative_to(root).as_posix()
        return f"`{name}`" if words.strip("`").endswith(place.lstrip("./")) else f"{words} (`{name}`)"

    # what stands in a fence is code
    parts = re.split(r"(^```.*?^```$)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(part if part.startswith("```") else LINK.sub(link, part) for part in parts)


def _parts(path):
    """The parts of a path without `..`."""
    out = []
    for part in path.parts:
        if part == "..":
            out.pop()
        else:
            out.append(part)
    return out


def _inline(words):
    """Words of a link as HTML."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", words)


class _Page(HTMLParser):
    """What a page of HTML refers to, and the anchors that it has."""

    def __init__(self):
        super().__init__()
        self.references, self.loaded, self.anchors = [], [], set()

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.anchors |= {values[name] for name in ("id", "name") if values.get(name)}
        if tag == "a" and values.get("href"):
            self.references.append(values["href"])
        if tag in ("script", "img", "iframe", "source") and values.get("src"):
            self.loaded.append(values["src"])
        is_loaded = {"stylesheet", "icon", "preload", "search", "shortcut"} & set((values.get("rel") or "").split())
        if tag == "link" and values.get("href") and is_loaded:
            self.loaded.append(values["href"])


def read(file):
    """References, loaded files and anchors of a page."""
    page = _Page()
    page.feed(file.read_text("utf-8"))
    return page


def external(book):
    """Scripts, styles, pictures and fonts that the pages of a book would load from elsewhere."""
    found = [f"{file.name}: {name}" for file in book.glob("*.html") for name in read(file).loaded if _is_far(name)]
    for file in book.rglob("*.css"):
        names = re.findall(r"(?:url\(|@import\s+)[\"']?([^\"')\s]+)", file.read_text("utf-8"))
        found += [f"{file.name}: {name}" for name in names if _is_far(name) and not name.startswith("data:")]
    return found


def broken(book, beside=True):
    """References of the pages to files or anchors that are not there; `beside` looks at what lies beside the book."""
    pages = {file.resolve(): read(file) for file in book.glob("*.html")}
    found = []
    for file, page in pages.items():
        for name in page.references + page.loaded:
            place = urlsplit(name)
            if _is_far(name) or name.startswith(("data:", "mailto:")):
                continue
            to = (file.parent / unquote(place.path)).resolve() if place.path else file
            if not to.is_relative_to(book.resolve()) and not beside:
                continue
            is_lost = to in pages and place.fragment and unquote(place.fragment) not in pages[to].anchors
            if not to.exists() or is_lost:
                found.append(f"{file.name}: {name}")
    return sorted(set(found))


def _is_far(name):
    return bool(urlsplit(name).netloc) or name.startswith("//")
