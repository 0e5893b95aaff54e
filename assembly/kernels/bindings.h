// What Python sees of the compiled functions.  Arrays are checked in the bindings and
// nowhere else; while a function runs, other threads of Python may.
#pragma once

#include <nanobind/nanobind.h>

void bind_linear(nanobind::module_ &m);
void bind_kinematics(nanobind::module_ &m);
void bind_solvers(nanobind::module_ &m);
void bind_statistics(nanobind::module_ &m);
