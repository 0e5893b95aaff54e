"""Random changes of the files and the arguments of a command, for ``fuzz.py``."""

import csv
import io
import json
import re
import tomllib
from pathlib import Path
from random import Random
from typing import Any

NUMBERS = [
    "nan", "inf", "-inf", "0", "-0.0", "-1", "1", "1e300", "-1e300", "1e-300", "5e-324",
    "1e400", "1_0", "0x10", "1.5", "7", "1e15", "99999999999999999999999", "9" * 400,
    "true", "1,5", "\u0661", "1e", "--1", "2e-16",
]  # fmt: skip
TEXTS = [
    "", " ", "-", "--", "a", "base", "x" * 300, "x" * 5000, "$x^2_a$", "<b>&amp;", "^",
    "[bold]", "[/]", "%s%d{x}", "\u00e9\u4e2d\U0001f916", "\u202e", "a\nb", "\t", "'",
    '"',
    "\\", "../..", "/", "~", "*", "no.file", "tx", "tx=", "=1", "tx=nan", "tx=1e300",
    "tx=0,tx=1", "rz=0:1:1e-9", "rz=0:1:0", "rz=1:0:0.1", "rz=0:inf:1", "q.crank=0.5",
    "z=0", "bore=0,0,0/0,0,0/1", "disc=", "fx=inf", "fx=1e300", "energy=-1", "drift=0",
    "temperature=nan", "frozen", "free", "budget", "least", "draw=nan", "\udcff",
]  # fmt: skip
PATHS = [
    ".", "..", "/", "/dev/null", "/dev/full", "campaign", "links", "empty", "notes.txt",
    "bar.toml", "swept.nc", "draws.nc", "poses.csv", "no/new.nc", "no.toml", "new.nc",
    "new.json", "new.png", "new.xyz", "new", "-", "", " ", "new\u00e9 $x$.json",
    "x" * 300 + ".json", "notes.txt/new.json", "solid.stl", "new.toml", "new.html",
    "campaign/measurements.csv", "bar.toml.journal", "kept.nc.journal", "\udcff.json",
    "notes.json", "notes.png", "notes.nc",
]  # fmt: skip
VALUES: list[Any] = [
    float("nan"), float("inf"), -1, 0, 1, 1e300, -1e300, 1e-300, 5e-324, 2**70, True,
    "", " ", "base", "x" * 5000, "$x^2_a$", "<b>", "[bold]", "a\nb", "\x1b[31m", [],
    [[]],
    [1], [0] * 3, [0] * 6, [-1] * 6, [1e200] * 3, [float("inf")] * 6, [[0.0] * 6] * 6,
    {}, {"a": 1}, {"a": {"b": [[[1]]]}}, [{}], "../x", "no.file", "\u00e9\u4e2d",
]  # fmt: skip
PIECES = [
    b"", b"\x00", b"\xff", b"\r", b"'", b'"', b"9", b"[", b"]", b"=", b",", b"\n",
    b"\n\n",
    b"#", b"\xef\xbb\xbf", b"\xe2\x80\xa8", b"{", b"-", b"e", b";", b"\xf0\x9f\xa4",
]  # fmt: skip
TEXT = {
    ".toml", ".csv", ".json", ".obj", ".urdf", ".xml", ".sdf", ".yaml", ".mtx", ".pch",
    ".txt", ".step", ".stl", ".ply", ".vtk", ".msh", ".dmig",
}  # fmt: skip
_TOKEN = re.compile(r"-?\d[\d.eE+_-]*|\"[^\"\n]*\"|\w+")


def change_file(path: Path, random: Random) -> str:
    """Change a file in place.

    Args:
        path: path of the file.
        random: random number generator.

    Returns:
        Name of the kind of change.
    """
    content = path.read_bytes()
    ways = [_bytes, _bytes, _cut]
    if path.suffix in TEXT:
        ways += [_token, _token, _lines, _rename, _coding, _units, _nested]
    if path.suffix in {".toml", ".json"}:
        ways += [_tree] * 4
    if path.suffix == ".csv":
        ways += [_cells] * 3
    way = random.choice(ways)
    for _ in range(random.choice([1, 1, 1, 2, 3])):
        content = way(content, random, path.suffix)
    path.write_bytes(content)
    return way.__name__.removeprefix("_")


def _bytes(content: bytes, random: Random, _: str) -> bytes:
    """Remove, repeat or replace bytes, or flip a bit."""
    start = random.randrange(len(content) + 1)
    stop = min(len(content), start + random.choice([0, 1, 1, 4, 40]))
    piece = content[start:stop]
    new = random.choice([b"", piece * 2, random.choice(PIECES), random.randbytes(3)])
    if piece and random.random() < 0.3:
        new = bytes([piece[0] ^ (1 << random.randrange(8))]) + piece[1:]
    return content[:start] + new + content[stop:]


def _cut(content: bytes, random: Random, _: str) -> bytes:
    """Truncate the file at a random position."""
    return content[: random.randrange(len(content) + 1)]


def _text(content: bytes) -> str:
    return content.decode("utf-8", errors="surrogateescape")


def _coded(text: str) -> bytes:
    return text.encode("utf-8", errors="surrogateescape")


def _token(content: bytes, random: Random, _: str) -> bytes:
    """Replace a number, string or name by another value."""
    text = _text(content)
    tokens = list(_TOKEN.finditer(text))
    if not tokens:
        return content
    one = random.choice(tokens)
    if one[0][0] in "-0123456789":
        new = random.choice(NUMBERS)
    elif one[0][0] == '"':
        new = json.dumps(random.choice(TEXTS), ensure_ascii=False)
    else:
        new = random.choice(tokens)[0]
    return _coded(text[: one.start()] + new + text[one.end() :])


def _lines(content: bytes, random: Random, _: str) -> bytes:
    """Remove, repeat or exchange lines."""
    lines = content.split(b"\n")
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    how = random.randrange(4)
    if how == 0:
        del lines[i]
    elif how == 1:
        lines.insert(j, lines[i])
    elif how == 2:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines[min(i, j) : max(i, j)] = []
    return b"\n".join(lines)


def _coding(content: bytes, random: Random, _: str) -> bytes:
    """Change line endings or the encoding, or add a byte order mark."""
    text = _text(content)
    how = random.randrange(6)
    if how < 2:
        return content.replace(b"\n", (b"\r\n", b"\r")[how])
    if how == 2:
        return b"\xef\xbb\xbf" + content
    coding = ("utf-16", "utf-16-be", "latin-1")[how - 3]
    return text.encode(coding, errors="replace")


def _units(content: bytes, random: Random, _: str) -> bytes:
    """Replace all occurrences of a unit."""
    units = ["mm", "um", "in", "m", "deg", "rad", "mrad", "K", "furlong", ""]
    text = _text(content)
    found = [u for u in units if u and re.search(rf"\b{u}\b", text)]
    if not found:
        return content
    new = random.choice(units)
    return _coded(re.sub(rf"\b{random.choice(found)}\b", new, text))


def _nested(content: bytes, random: Random, _: str) -> bytes:
    """Insert many nested brackets, tags or tables."""
    times = random.choice([20, 300, 3000, 200_000])
    pairs = {b"[": b"]", b"{": b"}", b"(": b")", b"<body>": b"</body>",
             b"<frame>": b"</frame>", b"<a>": b"</a>"}  # fmt: skip
    alone = [b"{a=", b"a.", b"-", b"0", b" ", b"\n[[frame]]", b",", b"[{"]
    piece = random.choice([*pairs, *alone])
    closing = pairs.get(piece, b"") * random.choice([0, times])
    start = random.randrange(len(content) + 1)
    return content[:start] + piece * times + closing + content[start:]


def _rename(content: bytes, random: Random, _: str) -> bytes:
    """Replace all occurrences of a name."""
    text = _text(content)
    names = re.findall(r'name = "([^"\n]+)"', text) or re.findall(r"[A-Za-z_.]+", text)
    if not names:
        return content
    new = random.choice([
        "$x^2_a$",
        "<b>",
        "a^b",
        "[bold]x[/]",
        "\u00e9 \u4e2d",
        "a.b",
        "#",
    ])
    return _coded(text.replace(random.choice(names), new))


def _tree(content: bytes, random: Random, suffix: str) -> bytes:
    """Remove, rename, repeat or replace a value of a TOML or JSON file."""
    try:
        text = content.decode("utf-8")
        data = tomllib.loads(text) if suffix == ".toml" else json.loads(text)
    except ValueError:
        return content
    path = random.choice(list(_places(data)))
    if not path:
        return content
    holder, key = data, path[-1]
    for step in path[:-1]:
        holder = holder[step]
    how = random.randrange(8)
    if how == 0:
        del holder[key]
    elif how == 1 and isinstance(holder, dict):
        holder[random.choice([key + "x", "", "a b", "name"])] = holder.pop(key)
    elif how == 2 and isinstance(holder, list):
        holder.insert(random.randrange(len(holder) + 1), holder[key])
    else:
        holder[key] = random.choice(VALUES)
    if suffix == ".json":
        return json.dumps(data).encode()
    return _coded(_toml(data))


def _places(value: Any, path: tuple = ()) -> Any:
    """Yield the paths to all values in nested tables and lists."""
    yield path
    items: Any = value.items() if isinstance(value, dict) else ()
    items = enumerate(value) if isinstance(value, list) else items
    for key, inner in items:
        yield from _places(inner, (*path, key))


def _toml(data: dict) -> str:
    """Return nested tables as TOML text."""
    lines, blocks = [], []
    for key, value in data.items():
        if (
            value
            and isinstance(value, list)
            and all(isinstance(v, dict) for v in value)
        ):
            for table in value:
                blocks += [f"[[{json.dumps(key)}]]"]
                blocks += [f"{json.dumps(k)} = {_written(v)}" for k, v in table.items()]
        else:
            lines.append(f"{json.dumps(key)} = {_written(value)}")
    return "\n".join([*lines, *blocks, ""])


def _written(value: Any) -> str:
    """Return a value as TOML text."""
    if isinstance(value, list):
        return "[" + ", ".join(map(_written, value)) + "]"
    if isinstance(value, dict):
        inner = (f"{json.dumps(k)} = {_written(v)}" for k, v in value.items())
        return "{ " + ", ".join(inner) + " }"
    if isinstance(value, str):
        return json.dumps(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _cells(content: bytes, random: Random, _: str) -> bytes:
    """Replace cells of a CSV table, or move a row or a column."""
    try:
        rows = list(csv.reader(io.StringIO(_text(content))))
    except csv.Error:
        return content
    rows = [row for row in rows if row]
    if not rows:
        return content
    row = random.choice(rows)
    place = random.randrange(len(row))
    how = random.randrange(4)
    if how == 0:
        del row[place]
    elif how == 1:
        row.insert(place, random.choice(row))
    else:
        row[place] = random.choice(NUMBERS + TEXTS)
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return _coded(buffer.getvalue())


def change_words(
    words: list[str], options: list[tuple[str, bool]], random: Random
) -> list[str]:
    """Change one to three arguments of a command.

    Args:
        words: arguments of a valid command.
        options: options of the command, and whether they require a value.
        random: random number generator.

    Returns:
        The changed arguments.  The first two are the name of the command and do not
        change.
    """
    words = list(words)
    for _ in range(random.choice([1, 1, 1, 2, 3])):
        at = random.randrange(1 if words[0] == "study" else 2, len(words) + 1)
        how = random.randrange(8)
        if how == 0 and at < len(words):
            del words[at]
        elif how == 1 and options:
            name, takes = random.choice(options)
            words += [name, _value("", random)] if takes else [name]
        elif how == 2 and at < len(words):
            words.insert(at, words[at])
        elif how == 3:
            words.insert(at, random.choice(TEXTS))
        elif at < len(words) and not words[at].startswith("--"):
            words[at] = _value(words[at], random)
    return [word for word in words if "\0" not in word]


def _value(old: str, random: Random) -> str:
    """Return an unusual value for an argument."""
    if "." in old and not old.replace(".", "").isdigit() and random.random() < 0.6:
        return random.choice(PATHS)
    pieces = re.split(r"([=,:])", old)
    if len(pieces) > 2 and random.random() < 0.6:
        pieces[2 * random.randrange(len(pieces) // 2 + 1)] = random.choice(
            NUMBERS + TEXTS
        )
        return "".join(pieces)
    return random.choice(NUMBERS + NUMBERS + TEXTS + PATHS)
