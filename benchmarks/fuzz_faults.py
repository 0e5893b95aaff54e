"""Check the result of a command that was run with invalid input."""

import json
import re
from pathlib import Path

# lines of progress, of verdicts and of the mesher on stderr
_OURS = re.compile(
    r"forcefit: |warning: |[^\n]*[━╸╺]|\s*$|[^\n]*: not written, |mesh \d"
    r"|([a-z -]+|\S+) *\d+/\d+|\S+ +\d+% |\d[\d,]* unknowns|[a-z -]+: \d+ of \d+"
)


def faults(words, status, out, err, before, after, left) -> list[str]:
    """Return the faults of a result, or an empty list."""
    faults = []
    if status not in {0, 1, 2, 130}:
        faults.append(f"status {status}")
    if "Traceback" in err:
        last = [line for line in err.splitlines() if line.strip()][-1]
        places = re.findall(r'File "([^"]+)", line (\d+)', err)
        ours = [f"{Path(f).name}:{n}" for f, n in places if "site-packages" not in f]
        return [f"traceback at {ours[-1] if ours else '?'}: {last[:100]}"]
    strange = [line for line in err.splitlines() if not _OURS.match(line)]
    if strange:
        faults.append(f"on stderr: {strange[0][:100]}")
    messages = [
        line for line in err.splitlines()
        if line.startswith("forcefit: ") and not line.startswith("forcefit: note: ")
    ]  # fmt: skip
    if status == 2 and len(messages) != 1:
        faults.append(f"{len(messages)} messages")
    if any(len(line) > 1000 for line in messages):
        faults.append("a message of more than 1000 characters")
    if status in {0, 1} and "-" in words[-1:] and "--json" in words[-2:]:
        try:
            json.loads(out)
        except ValueError:
            faults.append("stdout is not JSON")
    new = {name: content for name, content in after.items() if name not in before}
    other = [
        n for n in before if after.get(n) != before[n] and not may_change(n, after)
    ]
    if other:
        faults.append(f"changed: {other[0]}")
    if left:
        faults.append(f"left in the temporary folder: {left[0]}")
    for name, content in new.items():
        journal = name.endswith(".journal") and status in {1, 2, 130}
        library = name.startswith(("built", "links", "newfolder"))
        if status == 2 and not journal and not library:
            faults.append(f"written although refused: {name}")
        elif words[:2] == ["stiffness", "convert"]:
            pass  # text files of other programs are not checked
        elif not journal and not is_whole(name, content):
            faults.append(f"not whole: {name}")
    return faults


def may_change(name: str, after: dict[str, bytes]) -> bool:
    """Return whether a command may replace an existing file or fill an empty folder."""
    if name.endswith("/"):
        return any(other.startswith(name) for other in after)
    journal = name.endswith((".journal", ".journal.lock"))
    return journal or (name in after and is_whole(name, after[name]))


def is_whole(name: str, content: bytes) -> bool:
    """Return whether a file is complete."""
    path = Path(name)
    if path.suffix == ".json":
        try:
            return isinstance(json.loads(content), dict)
        except ValueError:
            return False
    ends = {
        ".png": (b"\x89PNG", b"IEND\xaeB`\x82"), ".svg": (b"<?xml", b"</svg>\n"),
        ".pdf": (b"%PDF", b"%%EOF\n"), ".html": (b"<!doctype", b"</html>\n"),
        ".toml": (b"", b"\n"), ".csv": (b"", b"\n"), ".nc": (b"\x89HDF", b""),
        ".jpg": (b"\xff\xd8", b"\xff\xd9"), ".tif": (b"II", b""), ".bmp": (b"BM", b""),
        ".npz": (b"PK", b""), ".urdf": (b"<", b">\n"),
        ".xml": (b"<", b">\n"), ".yaml": (b"", b"\n"),
        "": (b"", b"\n"), ".pch": (b"", b"\n"), ".mtx": (b"", b"\n"),
    }  # fmt: skip
    first, last = ends.get(path.suffix.lower(), (None, b""))
    return first is not None and content.startswith(first) and content.endswith(last)
