"""Definition of a sweep: quantities to compute, and points."""

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.sweeps.identity import program_hash, question_hash, robot_hash
from forcefit.assembly.sweeps.parameters import unit_of
from forcefit.assembly.sweeps.points import Points
from forcefit.assembly.sweeps.quantities import Question, record_type
from forcefit.assembly.sweeps.targets import LARGEST_GRID, Targets, unit_of_target
from forcefit.inputs.errors import BadInput
from forcefit.results.display import html_table, short_repr


@dataclass(frozen=True, eq=False)
class Sweep:
    """Quantities to compute, and the points at which to compute them.

    Attributes:
        question: quantities to compute at each point.
        targets: the postures.
        values: values of each varied parameter, in the order of ``question.varied``.
        draws: number of random draws of errors; 0 to use the errors in the robot file.
        command: command line of the sweep; empty if there is none.
        block_size: number of points per block.
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
                f"sweep: found {self.size} points, expected at most {LARGEST_GRID}"
            )

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
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
        """Return the points of a block."""
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
        """Units of varied parameters and posture components, by name."""
        robot = self.question.robot
        of_postures = {n: unit_of_target(n, robot) for n in self.targets.names}
        return {path: unit_of(path) for path in self.question.varied} | of_postures

    @cached_property
    def provenance(self) -> dict[str, str | int]:
        """Provenance of the results: attributes of the data set."""
        question = self.question
        provenance: dict[str, str | int] = {
            "robot": question.robot.name,
            "robot_sha256": robot_hash(question.robot),
            "program": f"forcefit {version('forcefit')}",
            "program_sha256": program_hash(),
            "assumption": question.assumption or "none",
            "near": repr(question.near),
        }
        if question.sources is not None:
            drawn = {k: v for k, v in vars(question.sources).items() if k != "robot"}
            provenance |= {"seed": question.seed, "errors_sha256": question_hash(drawn)}
        if self.command:
            provenance["command"] = self.command
        return provenance

    @property
    def identity(self) -> dict[str, str]:
        """Values that identify the sweep in its journal."""
        question = self.question
        identity = {k: str(v) for k, v in self.provenance.items() if k != "command"}
        values = [*self.values, *self.targets.values]
        return identity | {
            "points": " x ".join(
                f"{d} {n}" for d, n in zip(self.dims, self.shape, strict=True)
            ),
            "values_sha256": hashlib.sha256(
                b"".join(v.tobytes() for v in values)
                + json.dumps(self.targets.labels).encode()
            ).hexdigest(),
            "asked": " ".join(map(str, record_type(question).names or ())),
            "wrenches": " ".join(question.wrenches),
            "strength": str(question.strength),
            "conditions": str((question.load, question.gravity, dict(question.under))),
            "block": str(self.block_size),
            # digest of all attributes of ``question``
            "question_sha256": question_hash(question),
        }
