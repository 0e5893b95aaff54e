// Functions that add the compiled functions to the Python module.  Only the bindings
// check arrays.  They release Python's global lock while a compiled function runs.
#pragma once

#include <nanobind/nanobind.h>

void bind_linear(nanobind::module_ &m);
void bind_kinematics(nanobind::module_ &m);
void bind_solvers(nanobind::module_ &m);
void bind_statistics(nanobind::module_ &m);
