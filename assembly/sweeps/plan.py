"""What a sweep asks, and at which points."""

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from assembly.sweeps.identity import program_hash, question_hash, robot_hash
from assembly.sweeps.parameters import unit_of
from assembly.sweeps.points import Points
from assembly.sweeps.quantities import Question, record_type
from assembly.sweeps.targets import LARGEST_GRID, Targets, unit_of_target
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.errors import BadInput


@dataclass(frozen=True, eq=False)
class Sweep:
    """A question and the points at which it is asked.

    Attributes:
        question: what is asked at each point.
        targets: the postures.
        values: of each number that varies, in the order of ``question.varied``.
        draws: number of draws of errors; 0 for the robot's own.
        command: that asked for it, for provenance; empty if none did.
        block_size: points solved and journalled together.
    """

    question: Question
    targets: Targets
    values: tuple[NDArray, ...] = ()
    draws: int = 0
    command: str = ""
    block_size: int = 128

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        if self.size > LARGEST_GRID:
            raise BadInput(
                f"sweep: {self.size} points; expected at most {LARGEST_GRID}"
            )

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes of the points."""
        draw = ("draw",) if self.draws else ()
        return (*self.question.varied, *self.targets.dims, *draw)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points along each axis."""
        draw = (self.draws,) if self.draws else ()
        return (*(len(v) for v in self.values), *self.targets.shape, *draw)

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape, dtype=float))

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return -(-self.size // self.block_size)

    def points(self, block: int) -> Points:
        """The points of a block."""
        first = block * self.block_size
        numbers = np.arange(first, min(first + self.block_size, self.size))
        numbers, draws = np.divmod(numbers, max(1, self.draws))
        count = int(np.prod(self.targets.shape))
        designs, postures = np.divmod(numbers, count)
        values = np.empty((len(numbers), len(self.values)))
        if self.values:
            shape = tuple(len(v) for v in self.values)
            for k, places in enumerate(np.unravel_index(designs, shape)):
                values[:, k] = self.values[k][places]
        return Points(values, self.targets.at(postures), draws)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each number that varies and of each component of the postures."""
        robot = self.question.robot
        of_postures = {n: unit_of_target(n, robot) for n in self.targets.names}
        return {path: unit_of(path) for path in self.question.varied} | of_postures

    @cached_property
    def provenance(self) -> dict[str, str | int]:
        """Where the numbers come from, as attributes of the data set."""
        asked = self.question
        said: dict[str, str | int] = {
            "robot": asked.robot.name,
            "robot_sha256": robot_hash(asked.robot),
            "program": f"forcefit {version('forcefit')}",
            "program_sha256": program_hash(),
            "reading": asked.reading or "none",
            "near": repr(asked.near),
        }
        if asked.sources is not None:
            drawn = {k: v for k, v in vars(asked.sources).items() if k != "robot"}
            said |= {"seed": asked.seed, "errors_sha256": question_hash(drawn)}
        if self.command:
            said["command"] = self.command
        return said

    @property
    def identity(self) -> dict[str, str]:
        """What must be the same for two sweeps to share a journal."""
        asked = self.question
        said = {k: str(v) for k, v in self.provenance.items() if k != "command"}
        values = [*self.values, *self.targets.values]
        return said | {
            "points": " x ".join(
                f"{d} {n}" for d, n in zip(self.dims, self.shape, strict=True)
            ),
            "values_sha256": hashlib.sha256(
                b"".join(v.tobytes() for v in values)
                + json.dumps(self.targets.labels).encode()
            ).hexdigest(),
            "asked": " ".join(map(str, record_type(asked).names or ())),
            "wrenches": " ".join(asked.wrenches),
            "strength": str(asked.strength),
            "situation": str((asked.load, asked.gravity, dict(asked.under))),
            "block": str(self.block_size),
            # whatever is not named above
            "question_sha256": question_hash(asked),
        }
