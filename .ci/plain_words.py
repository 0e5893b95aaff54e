"""Report words of plain_words.txt in sources and pages.

Run ``python .ci/plain_words.py`` at the root of the repository.
"""

import io
import re
import sys
import tokenize
from pathlib import Path

LIST = Path(__file__).with_suffix(".txt")
FOLDERS = (
    ".ci", "assembly", "benchmarks", "docs", "examples", "forcefit", "meshes",
    "stiffness", "tests", "validation",
)  # fmt: skip
LIBRARY = {"assembly", "examples", "forcefit", "meshes", "stiffness", "validation"}
SOURCES = {".py", ".h", ".cpp", ".md"}
SKIPPED = {"CHANGELOG.md"}  # old entries are not changed


def read_list(text):
    """Return the sections of a word list, {section: {word: replacement}}."""
    sections, words = {}, {}
    for line in text.splitlines():
        if line.startswith("["):
            words = sections[line[1 : line.index("]")]] = {}
        elif line and not line.startswith("#"):
            word, _, plain = line.partition(" -> ")
            words[word] = plain
    return sections


def find_words(text, words, names=()):
    """Yield line number, word and replacement; ignore given names."""
    for name in names:
        text = text.replace(name, "")
    # a phrase may continue on the next line of a comment
    gap = r"(?:\s|#|//)+"
    phrases = [gap.join(map(re.escape, word.split())) for word in words]
    for match in re.finditer(rf"\b(?:{'|'.join(phrases)})\b", text, re.IGNORECASE):
        found = " ".join(re.sub(gap, " ", match[0]).lower().split())
        yield text.count("\n", 0, match.start()) + 1, found, words[found]


def comments(text, python=True):
    """Return the comments and docstrings of a source at their original lines."""
    if not python:  # C++
        return "\n".join(line.partition("//")[2] for line in text.splitlines())
    found, before = "", tokenize.NEWLINE
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        begins = before in {tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
        if token.type == tokenize.COMMENT or (token.type == tokenize.STRING and begins):
            found += "\n" * (token.start[0] - 1 - found.count("\n")) + token.string
        if token.type not in {tokenize.NL, tokenize.COMMENT}:
            before = token.type
    return found


def main():
    """Print each word with its file, line and replacement."""
    sections = read_list(LIST.read_text("utf-8"))
    paths = [*Path().glob("*.md")]
    paths += [path for folder in FOLDERS for path in Path(folder).rglob("*")]
    status = 0
    for path in sorted(paths):
        if path.suffix not in SOURCES or path.name in SKIPPED:
            continue
        text = path.read_text("utf-8")
        searched = [(text, sections["everywhere"])]
        if path.suffix == ".md":
            searched.append((text, sections["pages"]))
        elif path.parts[0] in LIBRARY:
            searched.append((
                comments(text, path.suffix == ".py"),
                sections["comments"],
            ))
        for part, words in searched:
            for line, found, plain in find_words(part, words, sections["names"]):
                print(f"{path}:{line}: {found!r}; write: {plain}")
                status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
