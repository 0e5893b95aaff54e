// Problems (22) and (21) of all points: what a library exports of them.
#pragma once

#include "energies.h"
#include "margins.h"

// Solves every point, as assemble_all of compiled_energy.py does.
EXPORTED void assemble_all(
    const Robot *robot, const Points *points, Solutions *out) {
    Energies energies(*robot, *points);
    in_blocks(all_of(points->count), [&](const Block &block, Whole pending) {
        return energies.solve(*points, block, pending, *out);
    });
}

// Margins of every point of a robot without springs, as compiled_zone.py's all_margins.
EXPORTED void all_margins(
    const Robot *robot, const Points *points, Margins *out) {
    ZoneMargins zone(*robot, *points);
    in_blocks(all_of(points->count), [&](const Block &block, Whole pending) {
        return zone.margins(*points, block, pending, *out);
    });
}
