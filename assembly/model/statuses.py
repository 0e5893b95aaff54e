"""Statuses of points and verdicts of comparisons, with their meanings.

A status describes whether a point has a result.  A verdict assesses a result.
"""

OK = "ok"
OUT_OF_REACH = "out of reach"
CANNOT_ASSEMBLE = "cannot assemble"
NO_EQUILIBRIUM = "no equilibrium"
SOLVER_FAILED = "solver failed"
SIMULATION_FAILED = "simulation failed"
INVALID_ROBOT = "invalid robot"
SINGULAR = "singular"
BEYOND_LIMITS = "beyond_limits"
BEYOND_SINGULARITY = "beyond_singularity"
FREE_MOTION = "free motion"
UNSTABLE = "unstable"
NOT_PROVED = "not proved"

MEANINGS = {
    OK: "there is an answer",
    OUT_OF_REACH: "no posture of the robot has this pose",
    CANNOT_ASSEMBLE: "the errors do not close, neither by springs nor by clearances",
    NO_EQUILIBRIUM: "a load drives a free motion, which no joint or spring resists",
    SOLVER_FAILED: "the search found no solution with a sufficient certificate",
    SIMULATION_FAILED: "the multibody simulation failed",
    INVALID_ROBOT: "the varied numbers are not those of a valid robot",
    SINGULAR: "the posture is singular (more degrees of freedom than nearby "
    "postures): the first-order analysis is inconclusive",
    BEYOND_LIMITS: "a joint's coordinate is beyond its limits",
    BEYOND_SINGULARITY: "home and this posture are separated by a singularity",
    FREE_MOTION: "the platform has a free motion, without resistance",
    UNSTABLE: "the equilibrium has a direction of negative stiffness",
    NOT_PROVED: "the certificate of the solution is not sufficient",
}
# Statuses of sweep points. Files contain the index of the status in this tuple.
OF_POINTS = (
    OK, OUT_OF_REACH, CANNOT_ASSEMBLE, SOLVER_FAILED, INVALID_ROBOT, NO_EQUILIBRIUM,
    SINGULAR, BEYOND_LIMITS, BEYOND_SINGULARITY,
)  # fmt: skip
# Statuses of points without results.
UNUSABLE = {OUT_OF_REACH, INVALID_ROBOT, SINGULAR, BEYOND_LIMITS}

# Verdicts on a single value: OK, or one of the following.
FAILS = "fails"
UNDECIDED = "undecided"
NO_SIGNAL = "no signal"
# Verdicts on a complete comparison: NO_SIGNAL, or one of the following.
PASSED = "passed"
FAILED = "failed"
NOT_DECIDED = "not decided"
NOT_RUN = "not run"
NO_ANSWER = "no answer"

# verdicts of a diagnosis
NONE_NEEDED = "none_needed"
EXPLAINED = "explained"
LEARNED = "learned"
AMBIGUOUS = "ambiguous"
OUTSIDE_LIBRARY = "outside_library"
NOT_ENOUGH_ROWS = "not_enough_rows"
DIAGNOSES = {
    NONE_NEEDED: "the declared model suffices",
    EXPLAINED: "the declared model lacks the effects named",
    LEARNED: "the library lacks a function that was learned",
    AMBIGUOUS: "the design cannot distinguish effects",
    OUTSIDE_LIBRARY: "no effect of the library explains the residual",
    NOT_ENOUGH_ROWS: "the rows are too few to distinguish a cause from chance",
}
