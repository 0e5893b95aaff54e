// Problems (22), (21) and (27), and the classical compliance, at several postures in
// parallel.
#include "assembled.h"
#include "compliances.h"
#include "pose_errors.h"

using namespace LANE_SPACE;

// largest number of points whose bodies are in memory at the same time
constexpr size_t AT_ONCE = 1024;

void bound_all(
    const Robot &robot, const Points &points, const Centres &centres,
    const ClearanceLoads &loads, const PoseErrorRequest &requested, Bounds &out) {
    ReachableSets sets(robot, points, centres, loads, requested.offset);
    std::vector<int64_t> left;
    for (int64_t i = 0; i < points.count; ++i)
        if (out.outcome[i] == COMPILED) left.push_back(i);
    const auto settle = [&](const Search &search, bool solved) {
        const int64_t i = search.body->point, half = search.half / 3;
        if (!solved) out.outcome[i] = REFERENCE;
        out.supports[i] += search.supports;
        out.bounds[half][2 * i] = search.low, out.bounds[half][2 * i + 1] = search.high;
        std::copy(search.best, search.best + 6, out.screw[half] + 6 * i);
    };
    for (size_t first = 0; first < left.size(); first += AT_ONCE) {
        const size_t last = std::min(left.size(), first + AT_ONCE);
        std::vector<Body> bodies;
        in_blocks({&left[first], &left[first] + last - first}, [&](const Block &block, Whole pending) {
            return sets.read_bodies(points, block, pending, bodies, out.outcome);
        });
        for (const auto &[size, tasks] : searches_of(bodies, requested.tolerance))
            Farthest(*tasks.front().body, size[0]).search(tasks, settle);
    }
}

void comply_all(const Robot &robot, const Points &points, Compliances &out) {
    Compliance compliance(robot, points);
    in_blocks(all_of(points.count), [&](const Block &block, Whole pending) {
        return compliance.comply(points, block, pending, out);
    });
}
