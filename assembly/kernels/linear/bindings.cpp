// Python bindings of problems (22), (21) and (27), and of the classical compliance.
#include "../arrays.h"
#include "../bindings.h"
#include "../kernels.h"

namespace {

// A robot's addresses, and the Python object that keeps its arrays alive.
struct KeptRobot {
    nb::object structure;
    Robot robot;
};

KeptRobot robot_of(nb::object s) {
    const auto array = [&](const char *name) { return s.attr(name); };
    Robot r = {};
    Size n, closures, np, ny, ends, ng, nu, cone_ends, nq;
    r.size = nb::cast<double>(array("size"));
    r.platform = nb::cast<int64_t>(array("platform"));
    r.on_path = reals(array("on_path"), "on_path", n);
    if (r.platform < 0 || r.platform >= n.value)
        throw nb::value_error("platform: expected the row of a frame");
    r.patterns = reals(array("patterns"), "patterns", np, closures);
    r.pattern_of = indices(array("pattern_of"), "pattern_of", np.value, n);
    r.springs = reals(array("springs"), "springs", ny, 6);
    r.spring_frame = indices(array("spring_frame"), "spring_frame", n.value, ny);
    r.spring_order = indices(array("spring_order"), "spring_order", ny.value, ny);
    r.of_joint = indices(array("of_joint"), "of_joint", 2, ny);
    r.groups = starts(array("groups"), "groups", ny.value, false, ends);
    ng.value = ends.value - 1;
    r.group_pattern = indices(array("group_pattern"), "group_pattern", np.value, ng);
    r.group_on_path = reals(array("group_on_path"), "group_on_path", ng);
    r.cone_frame = indices(array("cone_frame"), "cone_frame", n.value, nu);
    r.cone_axis = indices(array("cone_axis"), "cone_axis", 6, nu);
    r.cone_size = reals(array("cone_size"), "cone_size", nu);
    r.starts = starts(array("starts"), "starts", nu.value, true, cone_ends);
    r.free_frame = indices(array("free_frame"), "free_frame", n.value, nq);
    r.free_axis = indices(array("free_axis"), "free_axis", 6, nq);
    r.free_lead = reals(array("free_lead"), "free_lead", nq);
    r.free_bound = reals(array("free_bound"), "free_bound", nq);
    r.n = n.value, r.closures = closures.value, r.np = np.value, r.ny = ny.value;
    r.ng = ng.value, r.nu = nu.value, r.cones = cone_ends.value - 1, r.nq = nq.value;
    return {std::move(s), r};
}

// Read frames, nominal closure errors and geometric errors.  Each array has one row
// for each point or one row for all points.
Points points_of(
    const Robot &r, nb::handle T, nb::handle errors, nb::handle mismatch, Size &k) {
    Size postures, sets;
    Points points = {};
    points.T = reals(T, "T", postures, r.n, 4, 4);
    points.mismatch = reals(mismatch, "mismatch", postures);
    points.errors = reals(errors, "errors", sets, r.n, 6);
    points.posture_per_point = postures.value != 1;
    points.errors_per_point = sets.value != 1;
    k = points.posture_per_point ? postures : sets;
    if (points.errors_per_point) reals(errors, "errors", k, r.n, 6);
    points.count = k.value;
    return points;
}

void call_assemble_all(
    const KeptRobot &of, nb::handle T, nb::handle errors, nb::handle mismatch,
    nb::handle loads, nb::handle outcome, nb::handle energy, nb::handle bound,
    nb::handle without_clearance, nb::handle work, nb::handle platform_screw,
    nb::handle clearances, nb::handle motions, nb::handle multipliers,
    nb::handle residual, nb::handle elastic) {
    const Robot &r = of.robot;
    Size k, rows, columns;
    Points points = points_of(r, T, errors, mismatch, k);
    if (!loads.is_none()) {
        Size acting;
        points.loads = reals(loads, "loads", acting, 2, r.n, 6);
        points.loads_per_point = acting.value != 1;
        if (points.loads_per_point) reals(loads, "loads", k, 2, r.n, 6);
    }
    Solutions out;
    out.outcome = address<int64_t>(outcome, "outcome", k);
    out.energy = address<double>(energy, "energy", k);
    out.bound = address<double>(bound, "bound", k);
    out.without_clearance = address<double>(without_clearance, "without_clearance", k);
    out.work = address<double>(work, "work", k);
    out.platform_screw = address<double>(platform_screw, "platform_screw", k, 6);
    out.clearances = address<double>(clearances, "clearances", k, r.nu);
    out.motions = address<double>(motions, "motions", k, r.nq);
    out.multipliers = address<double>(multipliers, "multipliers", k, 6 * r.closures);
    out.residual = address<double>(residual, "residual", k);
    out.elastic = address<double>(elastic, "elastic", rows, columns);
    if (out.elastic) address<double>(elastic, "elastic", k, r.ny);
    const nb::gil_scoped_release others;
    if (points.count <= 2)
        few_lanes::assemble_all(r, points, out);
    else
        many_lanes::assemble_all(r, points, out);
}

void call_all_margins(
    const KeptRobot &of, nb::handle T, nb::handle errors, nb::handle mismatch,
    nb::handle margin, nb::handle bound, nb::handle forces, nb::handle outcome) {
    Size k;
    const Points points = points_of(of.robot, T, errors, mismatch, k);
    Margins out = {
        address<double>(margin, "margin", k), address<double>(bound, "bound", k),
        address<double>(forces, "forces", k, of.robot.nu),
        address<int64_t>(outcome, "outcome", k)};
    const nb::gil_scoped_release others;
    if (points.count <= 2)
        few_lanes::all_margins(of.robot, points, out);
    else
        many_lanes::all_margins(of.robot, points, out);
}

void call_bound_all(
    const KeptRobot &of, nb::handle T, nb::handle errors, nb::handle mismatch,
    nb::handle screws, nb::handle clearances, nb::handle motions, const KeptRobot &held,
    nb::handle multipliers, nb::handle held_clearances, nb::handle energy,
    nb::handle without_clearance, nb::handle cone_of, nb::handle offset,
    nb::handle tolerance, nb::handle rotation, nb::handle translation,
    nb::handle rotation_screw, nb::handle translation_screw, nb::handle supports,
    nb::handle outcome) {
    const Robot &r = of.robot, &h = held.robot;
    Size k, cones;
    cones.value = r.cones;
    const Points points = points_of(r, T, errors, mismatch, k);
    const Centres centres = {
        reals(screws, "screws", k, 6), reals(clearances, "clearances", k, r.nu),
        reals(motions, "motions", k, r.nq)};
    const ClearanceLoads loads = {
        &h, reals(multipliers, "multipliers", k, 6 * h.closures),
        reals(held_clearances, "held_clearances", k, h.nu), reals(energy, "energy", k),
        reals(without_clearance, "without_clearance", k),
        indices(cone_of, "cone_of", h.cones, cones)};
    const PoseErrorRequest requested = {
        reals(offset, "offset", 3), reals(tolerance, "tolerance", 2)};
    Bounds out = {
        {address<double>(rotation, "rotation", k, 2),
         address<double>(translation, "translation", k, 2)},
        {address<double>(rotation_screw, "rotation_screw", k, 6),
         address<double>(translation_screw, "translation_screw", k, 6)},
        address<int64_t>(supports, "supports", k),
        address<int64_t>(outcome, "outcome", k)};
    const nb::gil_scoped_release others;
    bound_all(r, points, centres, loads, requested, out);
}

void call_comply_all(
    const KeptRobot &of, nb::handle T, nb::handle errors, nb::handle mismatch,
    nb::handle springs, nb::handle status) {
    Size k;
    const Points points = points_of(of.robot, T, errors, mismatch, k);
    Compliances out = {
        address<double>(springs, "springs", k, 6, of.robot.ny),
        address<int64_t>(status, "status", k)};
    const nb::gil_scoped_release others;
    comply_all(of.robot, points, out);
}

}  // namespace

void bind_linear(nb::module_ &m) {
    nb::class_<KeptRobot>(m, "Robot")
        .def(nb::new_(&robot_of), nb::arg("structure"));
    m.def(
        "assemble_all", &call_assemble_all,
        nb::arg("robot"), nb::arg("T"), nb::arg("errors"), nb::arg("mismatch"),
        nb::arg("loads").none(), nb::arg("outcome"), nb::arg("energy"), nb::arg("bound"),
        nb::arg("without_clearance"), nb::arg("work"), nb::arg("platform_screw"),
        nb::arg("clearances"), nb::arg("motions"), nb::arg("multipliers"),
        nb::arg("residual"), nb::arg("elastic"));
    m.def(
        "all_margins", &call_all_margins,
        nb::arg("robot"), nb::arg("T"), nb::arg("errors"), nb::arg("mismatch"),
        nb::arg("margin"), nb::arg("bound"), nb::arg("forces"), nb::arg("outcome"));
    m.def(
        "bound_all", &call_bound_all,
        nb::arg("robot"), nb::arg("T"), nb::arg("errors"), nb::arg("mismatch"),
        nb::arg("screws"), nb::arg("clearances"), nb::arg("motions"), nb::arg("held"),
        nb::arg("multipliers"), nb::arg("held_clearances"), nb::arg("energy"),
        nb::arg("without_clearance"), nb::arg("cone_of"), nb::arg("offset"),
        nb::arg("tolerance"), nb::arg("rotation"), nb::arg("translation"),
        nb::arg("rotation_screw"), nb::arg("translation_screw"), nb::arg("supports"),
        nb::arg("outcome"));
    m.def(
        "comply_all", &call_comply_all,
        nb::arg("robot"), nb::arg("T"), nb::arg("errors"), nb::arg("mismatch"),
        nb::arg("springs"), nb::arg("status"));
}
