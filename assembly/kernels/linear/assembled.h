// Problems (22) and (21) at all points, with two lanes or with as many as a register
// holds.
#pragma once

#include "../kernels.h"
#include "energies.h"
#include "margins.h"

#ifdef FEW_LANES
namespace few_lanes {
#else
namespace many_lanes {
#endif
using namespace LANE_SPACE;

void assemble_all(const Robot &robot, const Points &points, Solutions &out) {
    Energies energies(robot, points);
    const auto solve = [&](const Block &block, Whole pending) {
        return energies.solve(points, block, pending, out);
    };
    in_blocks(all_of(points.count), solve);
    energies.postpones = false;
    in_blocks(energies.waiting, solve);
}

// The robot must not have springs.
void all_margins(const Robot &robot, const Points &points, Margins &out) {
    ZoneMargins zone(robot, points);
    in_blocks(all_of(points.count), [&](const Block &block, Whole pending) {
        return zone.margins(points, block, pending, out);
    });
}

}  // namespace
