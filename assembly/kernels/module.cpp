// One module of compiled functions, for one level of instructions.
#include "bindings.h"
#include "solvers/real.h"

NB_MODULE(MODULE, m) {
    nanobind::set_leak_warnings(false);  // robots remain until the program ends
    m.attr("lanes") = LANE_SPACE::LANES;
    m.attr("sources") = SOURCES;  // digest of the source files
    bind_linear(m);
    bind_kinematics(m);
    bind_solvers(m);
    bind_statistics(m);
}
