// Python module of the compiled functions, for one level of the instruction set.
#include "bindings.h"
#include "solvers/real.h"

NB_MODULE(MODULE, m) {
    nanobind::set_leak_warnings(false);  // Python caches robots until the program ends
    m.attr("lanes") = LANE_SPACE::LANES;
    m.attr("sources") = SOURCES;  // digest of the source files
    bind_linear(m);
    bind_kinematics(m);
    bind_solvers(m);
    bind_statistics(m);
}
