// Python bindings of the functions in assembly/kernels/solvers.
#include "../arrays.h"
#include "../bindings.h"
#include "../kernels.h"

namespace {

// Read a problem; its cones can have any number of columns.
ConeProblem problem_of(
    nb::handle G, nb::handle h, nb::handle d, nb::handle H, nb::handle k,
    nb::handle cones) {
    Size r, p, nu, ends;
    ConeProblem problem;
    problem.h = reals(h, "h", r);
    problem.d = reals(d, "d", nu);
    problem.k = reals(k, "k", p);
    problem.G = reals(G, "G", r, nu);
    problem.H = reals(H, "H", p, nu);
    problem.starts = starts(cones, "starts", nu.value, true, ends);
    problem.r = r.value, problem.p = p.value, problem.cones = ends.value - 1;
    return problem;
}

void call_interior_point(
    nb::handle G, nb::handle h, nb::handle d, nb::handle H, nb::handle k,
    nb::handle cones, double tolerance, nb::handle u, nb::handle y) {
    const ConeProblem problem = problem_of(G, h, d, H, k, cones);
    double *guess = address<double>(u, "u", problem.starts[problem.cones]);
    double *multipliers = address<double>(y, "y", problem.r + problem.p);
    const Limits limits = {0.0, tolerance, 0.0, 0};
    const nb::gil_scoped_release others;
    interior_point(problem, limits, guess, multipliers);
}

void call_newton(
    nb::handle G, nb::handle h, nb::handle d, nb::handle H, nb::handle k,
    nb::handle cones, double relative, double absolute, double first_sigma, int64_t steps,
    nb::handle u, nb::handle y) {
    const ConeProblem problem = problem_of(G, h, d, H, k, cones);
    double *guess = address<double>(u, "u", problem.starts[problem.cones]);
    double *multipliers = address<double>(y, "y", problem.r + problem.p);
    const Limits limits = {relative, absolute, first_sigma, steps};
    const nb::gil_scoped_release others;
    newton(problem, limits, guess, multipliers);
}

int64_t call_farthest(
    nb::handle centre, nb::handle X, nb::handle H, nb::handle start, nb::handle cones,
    int64_t half, double tolerance, const nb::callable &support, nb::handle bounds,
    nb::handle screw) {
    Size p, nv, ends;
    BodyRequest body;
    if (half != 0 && half != 3) throw nb::value_error("half: expected 0 or 3");
    body.start = reals(start, "start", nv);
    body.centre = reals(centre, "centre", 6);
    body.map = reals(X, "X", 6, nv);
    body.rows = reals(H, "H", p, nv);
    body.starts = starts(cones, "starts", nv.value, true, ends);
    body.p = p.value, body.cones = ends.value - 1, body.half = half;
    body.tolerance = tolerance;
    double *low_and_high = address<double>(bounds, "bounds", 2);
    double *best = address<double>(screw, "screw", 6);
    body.support = [&](const double *direction, double *height, double *attains,
                       double *w) {
        const nb::gil_scoped_acquire ours;
        const nb::tuple found = nb::cast<nb::tuple>(
            support(nb::make_tuple(direction[0], direction[1], direction[2])));
        *height = nb::cast<double>(found[0]);
        const double *from = reals(found[1], "screw", 6);
        std::copy(from, from + 6, attains);
        from = reals(found[2], "gradient", nv);
        std::copy(from, from + nv.value, w);
    };
    const nb::gil_scoped_release others;
    return farthest(body, low_and_high, best);
}

void call_farthest_points(
    nb::handle H, nb::handle cones, nb::handle d, nb::handle right, nb::handle tolerance,
    nb::handle points, nb::handle multipliers, nb::handle solved) {
    Size k, p, nu, ends;
    Directions request;
    request.rows = reals(H, "H", p, nu);
    request.starts = starts(cones, "starts", nu.value, true, ends);
    request.directions = reals(d, "d", k, nu);
    request.right = reals(right, "right", k, p);
    request.tolerance = reals(tolerance, "tolerance", k);
    request.count = k.value, request.p = p.value, request.cones = ends.value - 1;
    FarthestPoints out = {
        address<double>(points, "points", k, nu),
        address<double>(multipliers, "multipliers", k, p),
        address<int64_t>(solved, "solved", k)};
    const nb::gil_scoped_release others;
    farthest_points(request, out);
}

void call_minimise_all(
    nb::handle G, nb::handle h, nb::handle d, nb::handle H, nb::handle k,
    nb::handle cones, nb::handle u, nb::handle y) {
    Size count, r, p, nu, ends;
    ConeProblems problems;
    problems.h = reals(h, "h", count, r);
    problems.d = reals(d, "d", count, nu);
    problems.k = reals(k, "k", count, p);
    problems.G = reals(G, "G", r, nu);
    problems.H = reals(H, "H", p, nu);
    problems.starts = starts(cones, "starts", nu.value, true, ends);
    problems.count = count.value, problems.r = r.value, problems.p = p.value;
    problems.cones = ends.value - 1;
    double *points = address<double>(u, "u", count, nu);
    double *multipliers = address<double>(y, "y", count.value, problems.r + problems.p);
    const nb::gil_scoped_release others;
    minimise_all(problems, points, multipliers);
}

void call_closest_points(
    nb::handle rows, nb::handle cones, nb::handle from, nb::handle kept, nb::handle u,
    nb::handle solved) {
    Size count, p, nu, ends;
    Projections projections;
    projections.rows = reals(rows, "rows", p, nu);
    projections.starts = starts(cones, "starts", nu.value, true, ends);
    projections.from = reals(from, "from", count, nu);
    projections.kept = reals(kept, "kept", count, nu);
    projections.count = count.value, projections.p = p.value;
    projections.cones = ends.value - 1;
    double *points = address<double>(u, "u", count, nu);
    int64_t *done = address<int64_t>(solved, "solved", count);
    const nb::gil_scoped_release others;
    closest_points(projections, points, done);
}

}  // namespace

void bind_solvers(nb::module_ &m) {
    m.def(
        "interior_point", &call_interior_point,
        nb::arg("G"), nb::arg("h"), nb::arg("d"), nb::arg("H"), nb::arg("k"),
        nb::arg("starts"), nb::arg("tolerance"), nb::arg("u"), nb::arg("y"));
    m.def(
        "newton", &call_newton,
        nb::arg("G"), nb::arg("h"), nb::arg("d"), nb::arg("H"), nb::arg("k"),
        nb::arg("starts"), nb::arg("relative"), nb::arg("absolute"),
        nb::arg("first_sigma"), nb::arg("steps"), nb::arg("u"), nb::arg("y"));
    m.def(
        "farthest", &call_farthest,
        nb::arg("centre"), nb::arg("X"), nb::arg("H"), nb::arg("start"),
        nb::arg("starts"), nb::arg("half"), nb::arg("tolerance"), nb::arg("support"),
        nb::arg("bounds"), nb::arg("screw"));
    m.def(
        "farthest_points", &call_farthest_points,
        nb::arg("H"), nb::arg("starts"), nb::arg("d"), nb::arg("right"),
        nb::arg("tolerance"), nb::arg("points"), nb::arg("multipliers"),
        nb::arg("solved"));
    m.def(
        "minimise_all", &call_minimise_all,
        nb::arg("G"), nb::arg("h"), nb::arg("d"), nb::arg("H"), nb::arg("k"),
        nb::arg("starts"), nb::arg("u"), nb::arg("y"));
    m.def(
        "closest_points", &call_closest_points,
        nb::arg("rows"), nb::arg("starts"), nb::arg("from"), nb::arg("kept"),
        nb::arg("u"), nb::arg("solved"));
}
