// Python bindings of the billiard walk.
#include "../arrays.h"
#include "../bindings.h"
#include "../kernels.h"

namespace {

// Read unit cones, and the axes of Dikin's ellipsoid in them.
Ellipsoid ellipsoid_of(nb::handle axes, nb::handle gram, nb::handle cones) {
    Size nu, n, ends;
    Ellipsoid ellipsoid;
    ellipsoid.axes = reals(axes, "axes", nu, n);
    ellipsoid.gram = reals(gram, "gram", nu, nu);
    ellipsoid.starts = starts(cones, "starts", nu.value, true, ends);
    ellipsoid.nu = nu.value, ellipsoid.n = n.value, ellipsoid.cones = ends.value - 1;
    return ellipsoid;
}

// Return the bit generator of a capsule; the caller holds the generator's lock.
bitgen *bits_of(const nb::capsule &random) {
    return static_cast<bitgen *>(random.data("BitGenerator"));
}

void call_start_chains(
    nb::handle axes, nb::handle gram, nb::handle cones, nb::handle centre,
    const nb::capsule &random, nb::handle walks) {
    const Ellipsoid ellipsoid = ellipsoid_of(axes, gram, cones);
    Size chains;
    const double *from = reals(centre, "centre", ellipsoid.nu);
    double *to = address<double>(walks, "walks", chains, ellipsoid.nu);
    bitgen *bits = bits_of(random);
    const nb::gil_scoped_release others;
    start_chains(ellipsoid, from, bits, chains.value, to);
}

void call_billiard_walk(
    nb::handle axes, nb::handle gram, nb::handle cones, nb::handle to_screw,
    int64_t every, const nb::capsule &random, nb::handle u, nb::handle trace) {
    const Ellipsoid ellipsoid = ellipsoid_of(axes, gram, cones);
    Size kept;
    Trajectories requested;
    requested.to_screw = reals(to_screw, "to_screw", 6, ellipsoid.nu);
    double *point = address<double>(u, "u", ellipsoid.nu);
    double *screws = address<double>(trace, "trace", kept, 6);
    requested.kept = kept.value, requested.every = every;
    bitgen *bits = bits_of(random);
    const nb::gil_scoped_release others;
    billiard_walk(ellipsoid, requested, bits, point, screws);
}

}  // namespace

void bind_statistics(nb::module_ &m) {
    m.def(
        "start_chains", &call_start_chains,
        nb::arg("axes"), nb::arg("gram"), nb::arg("starts"), nb::arg("centre"),
        nb::arg("random"), nb::arg("walks"));
    m.def(
        "billiard_walk", &call_billiard_walk,
        nb::arg("axes"), nb::arg("gram"), nb::arg("starts"), nb::arg("to_screw"),
        nb::arg("every"), nb::arg("random"), nb::arg("u"), nb::arg("trace"));
}
