"""What mkdocs does beside its plugins: writes home, gallery, flags and API reference, and links code to the last."""

import json
import os
import posixpath
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
PACKAGES = ("pipeline", "sarsim")
LINK = re.compile(r"\[(!\[[^\]]*\]\([^)]*\)|[^\]]*)\]\((?!https?:)([^)#\s]+)(#[^)]*)?\)")
"""Markdown links to files: text or picture, path and anchor."""
ROOT_PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Pages of the site that are files of the repository's root."""
AT_ROOT = re.compile(r"(\]\(|src=\")(?!https?:|#)(docs/)?")
"""Where a link of a root page begins that leads into the repository, and whether it leads into ``docs/``."""
CODE = re.compile("`[^`\\n]+`")
NOTEBOOK = "docs/episode.ipynb"
PICTURE = re.compile(r"!\[([^\]]+)\]\((images/[^)]+)\)")
"""A picture of a page: what it shows, and its file."""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
MODULE_NAME = re.compile(r'(doc-module-name">)([\w.]+)')
"""The heading of a module in the reference, on its page."""
WIDTH = 80
"""Columns of the help texts on the page of flags."""


def packages(top: str) -> list[Path]:
    """The folders of a package that hold modules, the package's own first; links to other folders are left out."""
    found = [Path(folder) for folder, _, _ in os.walk(ROOT / top)]
    return sorted(folder.relative_to(ROOT) for folder in found if (folder / "__init__.py").exists())


def dotted(path: Path) -> str:
    """``pipeline.metric_map`` of ``pipeline/metric_map`` or ``pipeline/metric_map/__init__.py``."""
    return ".".join(p for p in path.with_suffix("").parts if p != "__init__")


def page_of(package: Path) -> str:
    """File of a package's page, from ``docs/``."""
    return f"api/{dotted(package)}.md"


def reference(package: Path) -> str:
    """The page of a package: its own docstring, then every module with every public name."""
    modules = sorted(dotted(p.relative_to(ROOT)) for p in (ROOT / package).glob("[!_]*.py"))
    own = f"# {dotted(package)}\n\n::: {dotted(package)}\n    options:\n      members: false\n"
    own += "      show_root_heading: false\n      show_root_toc_entry: false\n"
    return own + "".join(f"\n::: {module}\n" for module in modules)


def root_page(name: str) -> str:
    """A file of the repository's root as a page of the site."""
    text = (ROOT / name).read_text().replace(NOTEBOOK, "docs/notebook.md")
    text = text.replace("REPOSITORY_URL", PROJECT["urls"]["Repository"])
    return AT_ROOT.sub(lambda link: link[1] if link[2] else f"{link[1]}../", text)


def help_of(command: str) -> str:
    """What ``command --help`` prints."""
    module, _, function = PROJECT["scripts"][command].partition(":")
    call = f"import sys; sys.argv = [{command!r}, '--help']; from {module} import {function}; {function}()"
    environment = os.environ | {"COLUMNS": str(WIDTH), "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, check=True, env=environment)
    return done.stdout.decode()


def flags() -> str:
    """A page with the help text of every installed command."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        texts = zip(PROJECT["scripts"], pool.map(help_of, PROJECT["scripts"]), strict=True)
        parts = [f"## {command}\n\n```text\n{text.strip()}\n```\n" for command, text in texts]
    about = (
        "Every flag of every command, as `--help` prints it. [Commands](commands.md) says what each command is for."
    )
    return f"# Flags\n\n{about}\n\n" + "\n".join(parts)


def notebook() -> str:
    """The notebook as a page: its text, its code, and what that printed and drew."""
    parts = []
    for cell in json.loads((ROOT / NOTEBOOK).read_text())["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        parts += [shown(output) for output in cell.get("outputs", ())]
    return "\n\n".join(parts) + "\n"


def shown(output: dict[str, Any]) -> str:
    """An output of a cell of the notebook, text or picture, as Markdown."""
    if output["output_type"] == "stream":
        return f"```text\n{''.join(output['text']).rstrip()}\n```"
    return f'<img alt="What this code draws" src="data:image/png;base64,{output["data"]["image/png"]}">'


def gallery() -> str:
    """A page with every picture of the other pages, each of which leads to its page."""
    shown: dict[str, str] = {}
    for page in sorted((ROOT / "docs").glob("*.md")):
        for what, file in PICTURE.findall(page.read_text()):
            shown.setdefault(file, f"[![]({file}) {what}]({page.name})")
    pictures = "\n\n".join(shown.values())
    return f'# Gallery\n\n<div class="gallery" markdown>\n\n{pictures}\n\n</div>\n'


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the reference at the end of the navigation."""
    assert config.nav is not None
    rooms = {top: [{dotted(p): page_of(p)} for p in packages(top)] for top in PACKAGES}
    config.nav.append({"API": [{top: pages} for top, pages in rooms.items()]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that no file in ``docs/`` holds."""
    own = {page: root_page(name) for name, page in ROOT_PAGES.items()}
    own |= {"flags.md": flags(), "gallery.md": gallery(), "notebook.md": notebook()}
    for name, content in own.items():
        files.append(File.generated(config, name, content=content))
    for top in PACKAGES:
        for package in packages(top):
            files.append(File.generated(config, page_of(package), content=reference(package)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead links to modules into the reference; other files of the repository are named, not linked.

    Unlike GitHub, mkdocs would show the backslash before a bar in a table's code.
    """
    markdown = CODE.sub(lambda code: code[0].replace("\\|", "|"), markdown)
    folder = posixpath.dirname(f"docs/{page.file.src_uri}")
    outside = {f"docs/{file.src_uri}" for file in files if file.inclusion.is_excluded()}
    return LINK.sub(lambda link: inside(link, posixpath.normpath(f"{folder}/{link[2]}"), folder, outside), markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let a table's corner be a cell, for an empty heading says nothing; break names of modules after their dots."""
    html = html.replace("<th></th>", "<td></td>")
    return MODULE_NAME.sub(lambda name: name[1] + name[2].replace(".", ".<wbr>"), html)


def inside(link: re.Match[str], path: str, folder: str, outside: set[str]) -> str:
    """A page's link to a path of the repository, as the site has it; paths ``outside`` are not on it."""
    text, target = link[1], Path(path)
    if path in ROOT_PAGES:
        return f"[{text}]({posixpath.relpath(f'docs/{ROOT_PAGES[path]}', folder)}{link[3] or ''})"
    if target.parts[0] == "docs":
        return text if path in outside else link[0]
    if target.parts[0] not in PACKAGES:
        return text
    if target.suffix == ".py":
        return f"[{text}]({posixpath.relpath(f'docs/{page_of(target.parent)}', folder)}#{dotted(target)})"
    return f"[{text}]({posixpath.relpath(f'docs/{page_of(target)}', folder)})"
