// A convex polytope in three dimensions that is cut by planes; its corners are stored.
//
// A cut removes the corners above the plane and adds a corner where the plane meets an
// edge.  Two corners with two common planes form an edge.  Every corner has three
// planes.  A corner on a cutting plane counts as below it.  Where more than three
// planes meet, several corners therefore coincide.
#pragma once

#include <array>

#include "real.h"

namespace LANE_SPACE {

typedef std::array<double, 3> Point;

inline double inner(const Point &a, const Point &b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// The set of points below all planes so far.
class Polytope {
public:
    // Start with a box; `axes` are its orthonormal directions.
    void start_box(const Point *axes, const Point &low, const Point &high) {
        corners.clear();
        for (int i = 0; i < 8; ++i) {
            Corner corner = {};
            for (int axis = 0; axis < 3; ++axis) {
                const int side = i >> axis & 1;
                const double height = side ? high[axis] : low[axis];
                for (int a = 0; a < 3; ++a) corner.at[a] += height * axes[axis][a];
                corner.planes[axis] = 2 * axis + side;
            }
            corners.push_back(corner);
        }
        planes = 6;
    }

    // Keep the points x with normal.x <= height.  The polytope does not change if it
    // would have more than MOST corners.
    void cut(const Point &normal, double height) {
        const int plane = planes++, count = int(corners.size());
        double size = 0.0;
        for (Corner &corner : corners) {
            corner.above = inner(corner.at, normal) - height;
            for (double x : corner.at) size = std::max(size, std::fabs(x));
        }
        const double limit = 1e-14 * size;
        fresh.clear();
        for (int i = 0; i < count; ++i) {
            const Corner one = corners[i];
            if (one.above <= limit) continue;
            for (int j = 0; j < count; ++j) {
                const Corner &other = corners[j];
                if (other.above > limit) continue;
                int shared[2] = {-1, -1}, common = 0;  // the common planes
                for (int candidate : one.planes)
                    if (candidate == other.planes[0] || candidate == other.planes[1] ||
                        candidate == other.planes[2]) {
                        ++common;
                        shared[1] = shared[0], shared[0] = candidate;
                    }
                if (common < 2) continue;
                if (count + int(fresh.size()) == MOST) return;
                // a corner below the limit can be above the plane by rounding: it is
                // then itself the new corner
                const double share = std::min(1.0, one.above / (one.above - other.above));
                Corner corner = {{}, {shared[0], shared[1], plane}, 0.0};
                for (int a = 0; a < 3; ++a)
                    corner.at[a] = one.at[a] + share * (other.at[a] - one.at[a]);
                fresh.push_back(corner);
            }
        }
        const auto outside = [&](const Corner &corner) { return !(corner.above <= limit); };
        corners.erase(std::remove_if(corners.begin(), corners.end(), outside), corners.end());
        corners.insert(corners.end(), fresh.begin(), fresh.end());
    }

    // Return the corner farthest from the origin.
    Point farthest_corner() const {
        double best = -1.0;
        Point at = {};
        for (const Corner &corner : corners)
            if (const double size = inner(corner.at, corner.at); size > best)
                best = size, at = corner.at;
        return at;
    }

private:
    static constexpr int MOST = 4096;  // corners; 400 planes give at most about 800
    struct Corner {
        Point at;
        std::array<int, 3> planes;
        double above;  // height above the plane of the last cut
    };
    std::vector<Corner> corners, fresh;
    int planes = 0;
};

}  // namespace LANE_SPACE
