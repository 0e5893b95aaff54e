"""Run the code blocks of the documentation; ``test_tutorials.py`` runs the tutorials.

Each page is run in an empty folder that contains the files named on the page.  Brackets
around optional arguments are removed.
"""

import re
import shlex
import shutil
import tomllib

import numpy as np
import pytest
import typer

import forcefit as ff
from forcefit.commands.app import app
from tests.test_tutorials import BLOCK, DOCS, ROOT, blocks

PAGES = {path.stem: path for path in [*DOCS.glob("*.md"), ROOT / "README.md"]}
# pages that are run with the tutorials, and a page that requires large files
OTHERS = {"measuring_protocol", "platform_stiffness", "measured_data"}
# Commands that are not run, and options that are replaced to shorten the computation.
NOT_RUN = ("make ", "python ", "dask ", ".ci/run")
CLUSTER = ("dask_jobqueue", "dask_kubernetes")
FEWER = {
    "--draws 100000": "--draws 200", "--draws 10000 ": "--draws 200 ",
    "--draws 2000": "--draws 200", "--draws 1000": "--draws 4",
    "--importance 2048": "--importance 32", "tx=-0.4:0.4:0.05,": "tx=-0.1:0.1:0.1,",
    "tz=-0.6:-0.3:0.05": "tz=-0.5:-0.4:0.1", "--ratios 4,8,16,32": "--ratios 4,8",
    "tx=-0.4:0.4:0.1,tz=-0.5 --solids": "tx=-0.1:0.1:0.1,tz=-0.5 --solids",
    "radius=0.02:0.05:0.005": "radius=0.02:0.03:0.01", "--workers 2 ": "",
    "tx=-0.2:0.2:0.1,": "tx=-0.1:0.1:0.1,", "0:1.5:0.1": "0:0.2:0.1",
    "force=500": "force=500 --draws 100", "--rows 60": "--rows 8 --configurations 9",
}  # fmt: skip
NAMES = {
    "ROBOT": "irsbot2",
    "FOLDER": "made",
    "FILE.csv": "table.csv",
    "FILE": "answer.json",
}


def command_lines(text):
    """Yield the command lines of a shell block without comments and brackets."""
    whole = re.sub(r"\\\n\s*", "", text)
    for line in whole.splitlines():
        words = shlex.split(re.sub(r"[\[\]]", "", line), comments=True)
        if words:
            yield [NAMES.get(word, word) for word in words]


def commands_of(page):
    """Yield the arguments of all forcefit commands on a page."""
    for language, _, text in blocks(page):
        if language == "sh":
            for words in command_lines(text):
                if not " ".join(words).startswith(NOT_RUN):
                    assert words[0] == "forcefit", words
                    end = words.index(">") if ">" in words else None
                    yield words[1:end]


def parsed(words):
    """Parse a command line without running the command."""
    command, name = typer.main.get_command(app), words[0]
    while hasattr(command, "commands"):
        name, *words = words
        command = command.commands[name]
    # the names of the help option are cached when the first context is created
    own = app.info.context_settings
    return command.make_context(name, list(words), **own)


@pytest.mark.parametrize("name", sorted(PAGES))
def test_documented_commands_have_valid_options(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in commands_of(PAGES[name]):
        parsed(words)


def test_every_code_block_has_a_language():
    """A block without a language would not be run."""
    for page in PAGES.values():
        text = page.read_text(encoding="utf-8")
        fences = re.findall(r"^```.*$", text, re.M)
        assert len(fences) == 2 * len(BLOCK.findall(text)), page.name


FOUND = """
[[effect]]
name = "encoder_offset"
parameters = { joint2 = 1e-3 }
[[effect]]
name = "function"
where = "joint2"
components = ["rz"]
variables = ["q.joint2"]
form = "waves"
parameters = { "1.sine" = 1.2e-4, "1.cosine" = -3e-5 }
"""
CRANK = """
name = "crank"
platform = "tip"
[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
joint_stiffness = [inf, inf, 1e5, inf, inf, inf]
[[frame]]
name = "tip"
parent = "drive"
translation = [0.3, 0, 0]
"""


def test_toml_blocks_are_valid():
    for page in PAGES.values():
        for language, _, text in blocks(page):
            if language == "toml":
                tomllib.loads(text)


# files named on the documentation pages ---------------------------------------------
def arm(folder, run):
    """Write a campaign, a robot file with identified effects, and targets."""
    shutil.copytree(
        ROOT / "tests" / "campaigns" / "encoder_offset", folder / "CAMPAIGN"
    )
    robot = (folder / "CAMPAIGN" / "robot.toml").read_text()
    (folder / "corrected.toml").write_text(robot + FOUND)
    table = (folder / "CAMPAIGN" / "measurements.csv").read_text().splitlines()
    heads = table[0].split(",")
    kept = [k for k, head in enumerate(heads) if not head.startswith("meas")]
    rows = [",".join(row.split(",")[k] for k in kept) for row in table[:6]]
    for name in ("targets.csv", "table.csv"):
        (folder / name).write_text("\n".join(rows) + "\n")


def campaign(folder, run):
    """Write a campaign in which the model neglects the weight."""
    shutil.copytree(ROOT / "tests" / "campaigns" / "self_weight", folder / "CAMPAIGN")


def crank(folder, run):
    """Write a robot file with one drive and the effects shown on the page."""
    effects = next(text for language, _, text in blocks(DOCS / "effects.md")
                   if language == "toml")  # fmt: skip
    (folder / "corrected.toml").write_text(CRANK + effects)


def runs(folder, run):
    """Write the report pages of two runs."""
    from forcefit.page.page import Page, Provenance, page

    for name, worst in (("before", 2.0), ("after", 1.0)):
        about = Page(name, "", True, [], "", [], [], Provenance(), {"worst": worst})
        (folder / f"{name}.html").write_text(page(about))


def tracker(folder, run):
    """Write laser tracker data of a Delta robot, and the commands."""
    delta = ff.load_robot("delta")
    run("convert", "delta", "-o", folder / "delta.toml")
    platform = delta.index(delta.platform)
    rng = np.random.default_rng(1)  # noise of the readings
    points = {"SMR1": [0.05, 0.0, 0.02], "SMR2": [-0.03, 0.04, 0.02]}
    home = ff.place_robot(delta).transforms[platform][:3, 3]
    lines, commands = [], ["id;pose.tx;pose.ty;pose.tz"]
    for k in range(24):
        shift = home + 0.02 * np.array([
            np.cos(k % 6),
            np.sin(k % 6),
            np.cos(2 * k % 12),
        ])
        placed = ff.place_robot(
            delta, pose=dict(zip(("tx", "ty", "tz"), shift, strict=True))
        )
        commands.append(";".join([f"p{k}", *(f"{v:.9f}" for v in shift)]))
        for name, point in points.items():
            seen = placed.transforms[platform] @ [*point, 1.0]
            seen = 1e3 * seen[:3] + 100.0 + rng.normal(0.0, 0.005, 3)
            x, y, z = (f"{v:.5f}".replace(".", ",") for v in seen)
            lines.append(f"A::p{k}::{name}; {x}; {y}; {z}")
    for name in ("spatial_analyzer.txt", "export.txt"):
        (folder / name).write_text("\n".join(lines) + "\n")
    (folder / "commands.csv").write_text("\n".join(commands).replace("0.", "0,") + "\n")
    (folder / "smr.toml").write_text(_block("tracker_import", "smr.toml"))


def links(folder, run):
    """Write the stiffness matrix of a beam in the formats of other programs."""
    from scipy.io import mmwrite

    run("stiffness", "beam", "--length", 0.4, "--radius", 0.02, "--young", 6e10,
        "--poisson", 0.3, "--json", folder / "rod.json")  # fmt: skip
    run("stiffness", "convert", folder / "rod.json", "--to", "matrix-market", "--unit",
        "mm", "-o", folder / "rod.mtx")  # fmt: skip
    run("stiffness", "convert", folder / "rod.json", "--to", "matrix-market", "-o",
        folder / "full.mtx")  # fmt: skip
    mmwrite(folder / "m.mtx", np.eye(12))
    (folder / "nodes.csv").write_text("1,0,0,0\n2,0.4,0,0\n")


def robots(folder, run):
    """Write a robot in URDF, MJCF, SDF and TOML."""
    run("convert", "irsbot2", "-o", folder / "robot.urdf")
    shutil.copy(folder / "robot.yaml", folder / "loops.yaml")
    run("convert", "irsbot2", "-o", folder / "scene.xml")
    for name in ("corrected", "robot"):
        run("convert", "irsbot2", "-o", folder / f"{name}.toml")
    from tests.assembly.exchange.test_sdf import four_bar

    (folder / "robot.sdf").write_text(four_bar())


def plans(folder, run):
    """Write error distributions, tolerance plans, a path and a study of IRSBot-2."""
    shutil.copy(ROOT / "examples" / "irsbot2_errors.toml", folder / "errors.toml")
    for name in ("plan.toml", "mostly.toml"):
        shutil.copy(ROOT / "examples" / "tolerance_allocation" / "mostly.toml",
                    folder / name)  # fmt: skip
    (folder / "path.csv").write_text("pose.tx,pose.tz\n0.0,-0.5\n0.1,-0.5\n")
    (folder / "study.toml").write_text('robot = "irsbot2"\n')


def imperfect(folder, run):
    """Write a file of IRSBot-2 with a geometric error."""
    run("convert", "irsbot2", "-o", folder / "nominal.toml")
    text = (folder / "nominal.toml").read_text()
    name, error = 'name = "leg1.link_a"\n', "geometric_error = [1e-4, 0, 0, 0, 0, 0]\n"
    assert name in text
    (folder / "my_robot.toml").write_text(text.replace(name, name + error))


def with_errors(folder, run):
    """Run the Python block on the gallery page, which writes a robot file."""
    code = next(text for kind, _, text in blocks(DOCS / "gallery.md")
                if kind == "python")  # fmt: skip
    exec(compile(code, "gallery", "exec"), {})


def own_robot(folder, run):
    """Write the robot file of the tutorial."""
    text = _block("tutorials/own_robot", "my_robot.toml")
    (folder / "my_robot.toml").write_text(text)


def _block(page, title):
    """Return the code block with a given title on a page."""
    return next(t for _, name, t in blocks(DOCS / f"{page}.md") if name == title)


STAGE = {
    "campaigns": [campaign],
    "commands": [arm, plans, robots, links, tracker, with_errors],
    "conversion": [robots], "correction": [arm], "diagnosis": [campaign],
    "effects": [crank], "gallery": [plans, own_robot, with_errors],
    "link_exchange": [links],
    "reports": [campaign, plans, runs], "sweeps": [plans, robots],
    "tolerances": [imperfect], "tracker_import": [tracker],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize("name", sorted(set(PAGES) - OTHERS))
def test_documented_commands_run_without_error(name, tmp_path, monkeypatch, run):
    commands = list(commands_of(PAGES[name]))
    if not commands:
        pytest.skip("the page has no commands")
    for place in ("examples", "meshes", "tests"):
        (tmp_path / place).symlink_to(ROOT / place)
    monkeypatch.chdir(tmp_path)
    for stage in STAGE.get(name, []):
        stage(tmp_path, run)
    titled(name, tmp_path)
    for words in commands:
        line = shlex.join(words)
        for long, short in FEWER.items():
            line = line.replace(long, short)
        status, _, said = run(*shlex.split(line))
        assert status in {0, 1}, f"{line}\n{said}"


def titled(name, folder):
    """Write the files shown on a page."""
    for _, title, text in blocks(PAGES[name]):
        if title:
            (folder / title).write_text(text, encoding="utf-8")


@pytest.mark.parametrize("name", sorted(set(PAGES) - {"README"}))
def test_python_blocks_print_the_documented_output(name, tmp_path, monkeypatch, capsys):
    """All blocks of a page share one session.  The README has a separate test."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    titled(name, tmp_path)
    session, printed = {}, None
    for language, _, text in blocks(PAGES[name]):
        if language == "python" and not any(one in text for one in CLUSTER):
            exec(compile(text, name, "exec"), session)
            printed = capsys.readouterr().out
        elif language == "output" and printed is not None:
            same(text, printed)
        else:
            printed = None  # the next output block belongs to a command


NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?")


def same(shown, printed):
    """Check that two texts have equal words, and numbers equal to 0.1 %."""
    assert NUMBER.sub("#", shown).split() == NUMBER.sub("#", printed).split()
    for mine, yours in zip(shown.splitlines(), printed.splitlines(), strict=True):
        if "certificate" not in mine:  # rounding errors
            numbers = [[float(n) for n in NUMBER.findall(t)] for t in (mine, yours)]
            assert numbers[0] == pytest.approx(numbers[1], rel=1e-3, abs=1e-12)
