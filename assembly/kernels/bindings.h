// Python's interface to the compiled functions.  Only the bindings check arrays.  While a
// function runs, other Python threads may run.
#pragma once

#include <nanobind/nanobind.h>

void bind_linear(nanobind::module_ &m);
void bind_kinematics(nanobind::module_ &m);
void bind_solvers(nanobind::module_ &m);
void bind_statistics(nanobind::module_ &m);
