"""Statuses of points and verdicts of comparisons, with their meanings.

A status says whether a point has a result; a verdict says how good a result is.
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
    OUT_OF_REACH: "no posture has this pose",
    CANNOT_ASSEMBLE: "the errors cannot be closed, whatever the energy",
    NO_EQUILIBRIUM: "a load drives a motion that nothing resists",
    SOLVER_FAILED: "no answer whose certificate is good enough was found",
    SIMULATION_FAILED: "the multibody program gave no answer",
    INVALID_ROBOT: "the numbers varied make no valid robot",
    SINGULAR: "the robot has more freedoms than near by: first order decides nothing",
    BEYOND_LIMITS: "a joint stands beyond its limits",
    BEYOND_SINGULARITY: "not connected to home without passing a singularity",
    FREE_MOTION: "the platform moves without resistance",
    UNSTABLE: "the equilibrium has a direction of negative stiffness",
    NOT_PROVED: "an answer whose certificate is not good enough",
}
# statuses of the points of a sweep; a file stores the index in this list
OF_POINTS = (
    OK, OUT_OF_REACH, CANNOT_ASSEMBLE, SOLVER_FAILED, INVALID_ROBOT, NO_EQUILIBRIUM,
    SINGULAR, BEYOND_LIMITS, BEYOND_SINGULARITY,
)  # fmt: skip
# statuses of points at which no quantity is computed
UNUSABLE = {OUT_OF_REACH, INVALID_ROBOT, SINGULAR, BEYOND_LIMITS}

# verdicts on one value that is compared: OK, or one of these
FAILS = "fails"
UNDECIDED = "undecided"
NO_SIGNAL = "no signal"
# .. and on a whole comparison: NO_SIGNAL, or
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
    NONE_NEEDED: "the declared model is enough",
    EXPLAINED: "the declared model lacks the effects named",
    LEARNED: "the library lacks a function that was learned",
    AMBIGUOUS: "the design cannot tell which effect it is",
    OUTSIDE_LIBRARY: "no effect of the library explains the residual",
    NOT_ENOUGH_ROWS: "the rows are too few to tell a cause from chance",
}
