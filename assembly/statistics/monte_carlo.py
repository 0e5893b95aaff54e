"""Monte Carlo at one posture: errors drawn, problems (21) and (22) solved for each.

A block of draws is solved at a time, in any order and by any number of threads; each
draw depends on its own number and the seed alone.  With a file, finished blocks go to a
journal beside it from the first on: a run that was killed goes on where it stopped.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from assembly.link_stress import peak_stresses, stressed_links
from assembly.posture import POSE, Posture
from assembly.solvers.one_posture import OnePosture, prepare_energies
from assembly.solvers.posture_margins import PostureMargins, prepare_margins
from assembly.solvers.reduction import FreeMotion
from assembly.statistics.distributions import ErrorSources, draw_generator
from assembly.statistics.play import PLAY, settle_play
from assembly.sweeps.dataset import save_dataset
from assembly.sweeps.identity import program_hash, robot_hash
from assembly.sweeps.journal import open_journal
from assembly.sweeps.sweep import journal_path
from stiffness.reading import BadInput, nearest
from stiffness.screws import SCREW

if TYPE_CHECKING:
    import xarray

BLOCK = 4096  # draws solved and journalled together
_PLAY_STREAM = 1  # of random numbers; 0 is the errors'
_WAITING = 4  # blocks begun ahead of each thread
UNITS = {
    "energy": "J", "duality_gap": "J", "margin": "1", "margin_free": "1",
    "platform_screw": "rad, m", "rotation": "rad", "translation": "m", "force": "N",
    "moment": "N m", "stress": "Pa",
}  # fmt: skip
_MEANING = {
    "energy": "least elastic energy that closes it, eq. (22)",
    "duality_gap": "certified: energy is at most this too high",
    "margin": "factor on all clearances at which it just assembles, compliant rigid",
    "margin_free": "the same, compliant joints free about their own axis",
    "platform_screw": "pose error at the platform's origin, base axes",
    "rotation": "size of the platform's rotation error",
    "translation": "size of the platform's translation error",
    "force": "largest force through any body",
    "moment": "largest moment through any body",
    "stress": "largest von Mises stress in the link",
    "status": "0 solved, 1 no answer",
}


@dataclass(frozen=True, eq=False)
class Experiment:
    """What is drawn, and what is asked of each draw.

    Attributes:
        posture: where the robot stands; drawn errors take the place of its own.
        sources: of the errors.
        seed: of all draws.
        play: ``"least"``, ``"uniform"`` or ``"contact"``, see
            :mod:`assembly.statistics.play`.
        margins: whether the zone margins are asked for.
        stress: whether the links' stress is.
        load: (6,) [N m, N] on the platform at its origin, base axes; none if absent.
        gravity: (3,) [m/s^2] base axes; none if absent.
    """

    posture: Posture
    sources: ErrorSources
    seed: int = 1
    play: str = "least"
    margins: bool = True
    stress: bool = True
    load: tuple[float, ...] | None = None
    gravity: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.play not in PLAY:
            raise ValueError(f"play is {self.play!r}, expected one of {PLAY}")

    @cached_property
    def energies(self) -> OnePosture:
        """The posture made ready for (22).

        Raises:
            BadInput: the load drives a motion that nothing resists.
        """
        try:
            return prepare_energies(self.posture, self.load, self.gravity)
        except FreeMotion as error:
            raise BadInput(f"{self.posture.robot.name}: {error}") from None

    @cached_property
    def zones(self) -> dict[str, PostureMargins]:
        """And for (21), by quantity."""
        if not self.margins:
            return {}
        readings = {"margin": "rigid", "margin_free": "free"}
        return {k: prepare_margins(self.posture, r) for k, r in readings.items()}

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Frames of the links whose stress is known and asked for."""
        if not self.stress:
            return ()
        return tuple(link.frame for link in stressed_links(self.posture.robot))

    @cached_property
    def record_type(self) -> np.dtype:
        """A draw as a row of numbers."""
        shapes: dict[str, tuple[int, ...]] = {
            "energy": (), "duality_gap": (), "platform_screw": (6,), "force": (),
            "moment": (), "stress": (len(self.links),),
        }  # fmt: skip
        shapes |= dict.fromkeys(self.zones, ())
        fields = [(name, "<f8", shape) for name, shape in shapes.items()]
        return np.dtype([*fields, ("status", "u1")])

    def check_limits(self, limits: Iterable[str]) -> None:
        """Refuse limits on what is not computed here.

        Raises:
            BadInput: margins were left out, or no link's stress is known.
        """
        for name in limits:
            if name.startswith("margin") and not self.margins:
                raise BadInput(f"limit {name}: the margins were left out")
            if name == "stress" and not self.links:
                raise BadInput(
                    f"limit stress: no link of {self.posture.robot.name} has a shape "
                    "from which its stress follows"
                )

    def solve(self, first: int, count: int) -> NDArray:
        """Rows of the draws ``first`` .. ``first + count - 1``."""
        values = self.sources.draw(first, count, self.seed)
        draws = range(first, first + count)
        return self.answer(values, draws)

    def answer(self, values: NDArray, draws: range) -> NDArray:
        """Rows of given values of the sources.

        Args:
            values: (k, m) [rad or m].
            draws: k numbers, of the random numbers that settle the play.

        Returns:
            (k,) of :attr:`record_type`; NaN and status 1 where there is no answer.
        """
        errors = self.sources.errors(values)
        found = self.energies.solve(errors)
        rows = np.zeros(len(values), dtype=self.record_type)
        rows["energy"] = found.energy
        rows["duality_gap"] = np.maximum(0.0, found.energy - found.bound)
        screws = found.platform_screw
        if self.play != "least":
            rngs = [draw_generator(self.seed, d, _PLAY_STREAM) for d in draws]
            screws = settle_play(self.energies, found, self.play, rngs)
        rows["platform_screw"] = screws
        wrenches = self.energies.wrenches(found.multipliers)
        for name, part in (("moment", slice(0, 3)), ("force", slice(3, 6))):
            sizes = np.sqrt((wrenches[..., part] ** 2).sum(axis=-1))
            rows[name] = sizes.max(axis=1)
        if self.links:
            rows["stress"] = peak_stresses(self.posture.robot, wrenches)
        rows["status"] = ~np.isfinite(found.energy)
        for name, zone in self.zones.items():
            rows[name] = zone.solve(errors).margin
        return rows


def run_draws(
    experiment: Experiment,
    count: int,
    path: Path | str | None = None,
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
    held: ExitStack | None = None,
) -> "xarray.Dataset":
    """Solve draws 0 .. count - 1.

    Args:
        experiment: what is drawn and asked.
        count: how many draws.
        path: NetCDF file to write; its journal is used and then removed.
        workers: threads.
        progress: called with the draws done and their number.
        held: keeps the journal until it is closed, as in
            :func:`assembly.sweeps.sweep.run_sweep`.

    Returns:
        Data set over ``draw``; the file holds the same.

    Raises:
        BadInput: the journal is another run's or held by one, or a file cannot be
            written.
    """
    with ExitStack() as own:
        return _run_draws(experiment, count, path, workers, progress, held or own)


def _run_draws(
    experiment: Experiment, count: int, path: Path | str | None, workers: int,
    progress: Callable[[int, int], None], held: ExitStack,
) -> "xarray.Dataset":  # fmt: skip
    """The same; ``held`` keeps the journal."""
    blocks = -(-count // BLOCK)
    kept: dict[int, NDArray] = {}
    journal = None
    if path is not None:
        identity = provenance(experiment) | {"draws": count, "block": BLOCK}
        journal = held.enter_context(
            open_journal(journal_path(path), identity, experiment.record_type)
        )
        kept = {b: journal.read(b)[0] for b in journal.places}
    done = sum(map(len, kept.values()))
    progress(done, count)
    missing = [b for b in range(blocks) if b not in kept]
    with threadpool_limits(1):  # the threads are ours
        for block, rows in _solved(experiment, missing, count, workers):
            if journal is not None:
                journal.add(block, rows, {})
            kept[block] = rows
            done += len(rows)
            progress(done, count)
    data = draws_dataset(experiment, np.concatenate([kept[b] for b in range(blocks)]))
    if path is not None and journal is not None:
        save_dataset(data, path)
        journal.remove_after(held)
    return data


def _solved(
    experiment: Experiment, blocks: list[int], count: int, workers: int
) -> Iterator[tuple[int, NDArray]]:
    """Blocks as they are finished; a few are begun ahead, so memory stays bounded."""

    def solve(block: int) -> tuple[int, NDArray]:
        first = block * BLOCK
        return block, experiment.solve(first, min(BLOCK, count - first))

    if not blocks:
        return
    # made ready once, before the threads ask for it
    yield solve(blocks[0])
    waiting = iter(blocks[1:])
    with ThreadPoolExecutor(workers) as pool:
        begun: set[Future] = set()
        try:
            while True:
                for block in waiting:
                    begun.add(pool.submit(solve, block))
                    if len(begun) >= _WAITING * workers:
                        break
                if not begun:
                    return
                finished, begun = wait(begun, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        finally:
            for future in begun:
                future.cancel()


def provenance(experiment: Experiment) -> dict[str, str | int]:
    """What must be the same for two runs to give the same draws."""
    posture, sources = experiment.posture, experiment.sources
    numbers = [
        sources.frame, sources.component, sources.kind, sources.centre, sources.scale,
        sources.least, sources.limit, sources.signed, posture.transforms,
    ]  # fmt: skip
    digest = sha256(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers))
    return {
        "robot": posture.robot.name,
        "robot_sha256": robot_hash(posture.robot),
        "sources_and_posture_sha256": digest.hexdigest(),
        "seed": experiment.seed,
        "play": experiment.play,
        "margins": int(experiment.margins),
        "stress": int(experiment.stress),
        "load": " ".join(map(repr, experiment.load or ())),
        "gravity": " ".join(map(repr, experiment.gravity or ())),
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
    }


def draws_dataset(experiment: Experiment, rows: NDArray) -> "xarray.Dataset":
    """The draws as a data set with units and where they came from.

    Args:
        experiment: whose draws.
        rows: (k,) of its record type.

    Returns:
        Data set over ``draw``, with the sizes of the platform's error beside it.
    """
    import xarray

    dims = {"platform_screw": ("draw", "screw"), "stress": ("draw", "link")}
    names = rows.dtype.names or ()
    data = {name: (dims.get(name, ("draw",)), rows[name]) for name in names}
    screws = rows["platform_screw"]
    for name, part in (("rotation", slice(0, 3)), ("translation", slice(3, 6))):
        data[name] = (("draw",), np.sqrt((screws[:, part] ** 2).sum(axis=1)))
    variables = {
        name: (*value, {"units": UNITS.get(name, "1"), "long_name": _MEANING[name]})
        for name, value in data.items()
    }
    labels = {
        "draw": np.arange(len(rows)), "screw": list(SCREW),
        "link": list(experiment.links), "source": list(experiment.sources.labels),
    }  # fmt: skip
    pose = experiment.posture.pose()
    said = {f"pose.{k}": pose[k] for k in POSE if k in pose}
    return xarray.Dataset(variables, labels, provenance(experiment) | said)


def limit_names() -> tuple[str, ...]:
    """Quantities that may be limited."""
    return tuple(k for k in UNITS if k not in {"platform_screw", "duality_gap"})


def parse_limit(text: str) -> tuple[str, float]:
    """Quantity and limit from text such as ``"energy=5"``.

    Args:
        text: one of energy [J], margin, margin_free, rotation [rad], translation [m],
            force [N], moment [N m], stress [Pa], and a number > 0.

    Returns:
        Both.

    Raises:
        BadInput: not of that form.
    """
    name, _, number = (piece.strip() for piece in text.partition("="))
    valid = limit_names()
    if name not in valid:
        raise BadInput(f'--limit: unknown quantity "{name[:60]}"{nearest(name, valid)}')
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if not 0 < value < np.inf:
        raise BadInput(f'--limit {name}: found "{number[:60]}", expected a number > 0')
    return name, value
