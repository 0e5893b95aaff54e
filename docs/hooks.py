r"""Hooks of mkdocs: convert formulas, scenes, tables of numbers and docstring roles.

Formulas are written as on GitHub, either in a fenced block ``math`` or as $`x`$ within
a line.  Building the site converts them to MathML, which browsers from 2023 or later
display without a script or a network.  ``\tag{22}`` at the end of a block sets the
equation number, which is that of the paper.
"""

import re
import shlex
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File

# role of ":func:`name`" in a docstring, after the name was converted to code
_ROLE = re.compile(r"(?<![\w:]):(?:func|mod|class|meth|data|attr|math):(?=<code>)")

# numeric constant of a module, followed by a comment that explains it
_NUMBER = re.compile(
    r"^_?([A-Z][A-Z_]*)(?:: .+)? = ([^\"'#\n]*\d[^\"'#\n]*)  # (.+)$", re.M
)
_NUMBERS = "<!-- numbers of the code -->"
_CHANGES = "<!-- CHANGELOG.md -->"
_ROOT = Path(__file__).parents[1]

# command that writes a scene
_COMMAND = re.compile(r"^forcefit assembly show .*(?:\\\n.*)*\.html$", re.M)

# equation number at the end of a block
_TAG = re.compile(r"\\tag\{([^}]+)\}\s*$")


def on_config(config: Any, **_: Any) -> Any:
    """Enable formulas in fenced blocks and within lines."""
    fences = config.mdx_configs.setdefault("pymdownx.superfences", {})
    fences["custom_fences"] = [{"name": "math", "class": "math", "format": equation}]
    config.markdown_extensions.append(_Formulas())
    return config


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Add the example notebooks for download, and the scenes of the gallery."""
    for path in sorted((_ROOT / "examples" / "notebooks").glob("*.ipynb")):
        name = f"notebooks/{path.name}"
        files.append(File.generated(config, name, abs_src_path=str(path)))
    gallery = (_ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    for name, content in _scenes(gallery).items():
        files.append(File.generated(config, f"scenes/{name}", content=content))
    return files


def _scenes(gallery: str) -> dict[str, str]:
    """Run the commands shown in the gallery, and return the scenes linked there."""
    wanted = re.findall(r"\]\(scenes/([\w.]+)\)", gallery)
    commands = {c.split()[-1]: c for c in _COMMAND.findall(gallery)}
    with TemporaryDirectory() as folder:
        return {name: _made(commands[name], Path(folder) / name) for name in wanted}


def _made(command: str, path: Path) -> str:
    """Return the file that a command writes, with its output path replaced."""
    from typer.main import get_command

    from forcefit.commands.app import app

    words = shlex.split(command.replace("\\\n", " "))[1:-1]
    words = [str(_ROOT / w) if w.startswith("examples/") else w for w in words]
    with redirect_stdout(None), redirect_stderr(None):
        get_command(app)([*words, str(path)], standalone_mode=False)
    return path.read_text(encoding="utf-8")


def equation(source: str, *_: Any, **__: Any) -> str:
    """Format a fenced formula as HTML, with its number and a corresponding anchor."""
    tag = _TAG.search(source)
    formula = convert(_TAG.sub("", source).strip(), display="block")
    if tag is None:
        return f'<div class="equation">{formula}</div>'
    anchor = "eq-" + tag[1].split("-")[0].rstrip("abc")
    number = f'<span class="equation-number">({tag[1]})</span>'
    return f'<div class="equation" id="{anchor}">{formula}{number}</div>'


class _Formula(InlineProcessor):
    """Inline pattern that converts a formula within a line."""

    def handleMatch(self, m: Any, data: str) -> Any:
        return self.md.htmlStash.store(convert(m[1])), m.start(0), m.end(0)


class _Formulas(Extension):
    """Extension that matches formulas before inline code, which also uses backticks."""

    def extendMarkdown(self, md: Markdown) -> None:
        md.inlinePatterns.register(_Formula(r"\$`([^`]+)`\$", md), "formula", 195)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Insert the changelog, and the table of numeric constants of the diagnosis."""
    if _CHANGES in markdown:
        text = (_ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
        markdown = markdown.replace(_CHANGES, text.replace("](docs/", "]("))
    return markdown.replace(_NUMBERS, _numbers()) if _NUMBERS in markdown else markdown


def _numbers() -> str:
    """Return a table of the numeric constants in ``validation/diagnosis``."""
    rows = ["| module | number | value | what it is |", "|---|---|---|---|"]
    for path in sorted((_ROOT / "validation" / "diagnosis").glob("*.py")):
        for name, value, reason in _NUMBER.findall(path.read_text(encoding="utf-8")):
            words = name.lower().replace("_", " "), reason.replace("|", "or")
            rows.append(f"| {path.stem} | {words[0]} | {value} | {words[1]} |")
    return "\n".join(rows)


def on_page_content(html: str, **_: Any) -> str:
    """Remove the roles in front of names in docstrings."""
    return _ROLE.sub("", html)


def on_post_page(output: str, **_: Any) -> str:
    """Label the search for screen readers, because the theme does not."""
    search = 'data-md-component="search" role="dialog"'
    return output.replace(search, f'{search} aria-label="Search"')


@event_priority(-100)  # after the search plugin, which writes the index
def on_post_build(config: Any, **_: Any) -> None:
    """Write the search index as a script, which pages opened from disk can load."""
    folder = Path(config.site_dir) / "search"
    index = (folder / "search_index.json").read_text(encoding="utf-8")
    (folder / "search_index.js").write_text(f"var __index = {index}", encoding="utf-8")
