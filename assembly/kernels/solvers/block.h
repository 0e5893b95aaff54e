// Blocks of problems that are solved in parallel.  A block assigns one problem, called
// a point, to each lane (real.h).
#pragma once

#include "real.h"

namespace LANE_SPACE {

// The index of the point in each lane.  `stride` is the number of array entries per
// point.
struct Block {
    int64_t point[LANES];

    Real read(const double *from, int64_t stride, int64_t at) const {
        Real x;
        for (int l = 0; l < LANES; ++l) x[l] = from[point[l] * stride + at];
        return x;
    }
    void write(double *to, int64_t stride, int64_t at, Real x, Whole where) const {
        for (int l = 0; l < LANES; ++l)
            if (where[l]) to[point[l] * stride + at] = x[l];
    }
};

// Return the indices 0 .. count - 1.
inline std::vector<int64_t> all_of(int64_t count) {
    std::vector<int64_t> all(count);
    std::iota(all.begin(), all.end(), 0);
    return all;
}

// Solve the points in blocks.  `solve` receives a block and a mask of the lanes to
// solve.  It returns the mask of the lanes that it has not solved; these are tried
// again.  Unused lanes contain the last point, and their mask is 0.
template <typename Solve>
inline void in_blocks(const std::vector<int64_t> &points, Solve solve) {
    for (size_t first = 0; first < points.size(); first += LANES) {
        Block block;
        Whole pending;
        for (int l = 0; l < LANES; ++l) {
            const bool inside = first + l < points.size();
            block.point[l] = inside ? points[first + l] : points.back();
            pending[l] = inside ? -1 : 0;
        }
        while (any(pending)) pending = solve(block, pending);
    }
}

}  // namespace LANE_SPACE
