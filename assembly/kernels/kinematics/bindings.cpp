// Python binding of the continuation to several targets (continuation.cpp).
#include "../arrays.h"
#include "../bindings.h"
#include "../kernels.h"

namespace {

// The addresses of a robot's joints and closures, and the Python object that keeps
// their arrays alive.
struct KeptTree {
    nb::object arrays;
    Tree tree;
};

KeptTree tree_of(
    nb::handle parents, nb::handle kinds, nb::handle fixed, nb::handle leads,
    nb::handle pairs, nb::handle moves, nb::handle groups, int64_t platform,
    double size) {
    Size n, closures, count, ends;
    Tree tree = {};
    tree.size = size, tree.platform = platform;
    tree.parents = integers(parents, "parents", n);
    for (int64_t i = 0; i < n.value; ++i)
        if (tree.parents[i] >= i) throw nb::value_error("parents: expected frames before");
    tree.kinds = indices(kinds, "kinds", 3, n);
    tree.fixed = reals(fixed, "fixed", n, 4, 4);
    tree.leads = reals(leads, "leads", n);
    tree.pairs = integers(pairs, "pairs", closures, 2);
    for (int64_t i = 0; i < 2 * closures.value; ++i)
        if (tree.pairs[i] < 0 || tree.pairs[i] >= n.value)
            throw nb::value_error("pairs: expected rows of frames");
    tree.moves = integers(moves, "moves", count, 2);
    for (int64_t i = 0; i < count.value; ++i)
        if (tree.moves[2 * i] < 0 || tree.moves[2 * i] >= n.value)
            throw nb::value_error("moves: expected rows of frames");
    ends.value = closures.value + 2;
    tree.groups = starts(groups, "groups", count.value, true, ends);
    if (platform < 0 || platform >= n.value)
        throw nb::value_error("platform: expected the row of a frame");
    tree.n = n.value, tree.closures = closures.value;
    return {nb::make_tuple(parents, kinds, fixed, leads, pairs, moves, groups), tree};
}

void call_follow_all(
    const KeptTree &of, nb::handle start, nb::handle poses, nb::handle held, bool guess,
    nb::handle ends, nb::handle progress, nb::handle transforms, nb::handle still_open) {
    const Tree &tree = of.tree;
    Size k, posed;
    Targets targets = {};
    targets.start = reals(start, "start", tree.n);
    targets.held = reals(held, "held", k, tree.n);
    targets.poses = reals(poses, "poses", posed, 6);
    if (targets.poses && posed.value != k.value) reals(poses, "poses", k, 6);
    targets.count = k.value, targets.guess = guess;
    Tracks out = {
        address<double>(ends, "ends", k, tree.n), address<double>(progress, "progress", k),
        address<double>(transforms, "transforms", k, tree.n, 4, 4),
        address<double>(still_open, "still_open", k, tree.closures)};
    const nb::gil_scoped_release others;
    follow_all(tree, targets, out);
}

}  // namespace

void bind_kinematics(nb::module_ &m) {
    nb::class_<KeptTree>(m, "Tree")
        .def(nb::new_(&tree_of),
        nb::arg("parents"), nb::arg("kinds"), nb::arg("fixed"), nb::arg("leads"),
        nb::arg("pairs"), nb::arg("moves"), nb::arg("groups"), nb::arg("platform"),
        nb::arg("size"));
    m.def(
        "follow_all", &call_follow_all,
        nb::arg("tree"), nb::arg("start"), nb::arg("poses"), nb::arg("held"),
        nb::arg("guess"), nb::arg("ends"), nb::arg("progress"), nb::arg("transforms"),
        nb::arg("still_open"));
}
