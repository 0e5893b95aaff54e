// Problems (22), without loads, and (21), one in each thread of a device: the headers of
// lanes.cpp, with one lane.  Compiled for a device at run time, where there is one, and
// for this machine, where threads take turns, to be tested.
#define ON_DEVICE
#include "../kernels/linear/energies.h"
#include "../kernels/linear/margins.h"

using namespace LANE_SPACE;

#ifdef __CUDACC_RTC__
#define EXPORTED extern "C" __global__
#else
#define EXPORTED extern "C" __attribute__((visibility("default")))
EXPORTED const char *source_digest() { return SOURCE_DIGEST; }
#endif

#ifndef ROOM
#define ROOM 65536
#endif

#ifdef __CUDACC_RTC__
// Calls work(thread, of how many) on this thread.
template <typename Work> inline void on_threads(int64_t, Work work) {
    const int64_t own = int64_t(blockIdx.x) * blockDim.x + threadIdx.x;
    work(own, int64_t(gridDim.x) * blockDim.x);
}
#else
template <typename Work> inline void on_threads(int64_t threads, Work work) {
    for (int64_t own = 0; own < threads; ++own) work(own, threads);
}
#endif

// Every thread takes the points that are `threads` apart.
template <typename Problem, typename Solve>
inline void solve_points(
    const Robot &robot, const Points &points, int64_t threads, Solve solve) {
    on_threads(threads, [&](int64_t first, int64_t step) {
        alignas(16) char room[ROOM];
        arena().begin(room, ROOM);
        const Arena::Mark empty = arena().mark();
        Problem problem(robot, points);
        const Arena::Mark kept = arena().mark();
        for (int64_t i = first; i < points.count; i += step) {
            solve(problem, Block{{i}}, whole(-1));
            arena().back_to(kept);
        }
        arena().back_to(empty);
    });
}

EXPORTED void assemble_all(
    const Robot *robot, const Points *points, const Solutions *out, int64_t threads) {
    solve_points<Energies>(*robot, *points, threads, [&](Energies &energies, const Block &block, Whole asked) {
        Solutions rows = *out;
        energies.solve(*points, block, asked, rows);
    });
}

EXPORTED void all_margins(
    const Robot *robot, const Points *points, const Margins *out, int64_t threads) {
    solve_points<ZoneMargins>(*robot, *points, threads, [&](ZoneMargins &zone, const Block &block, Whole asked) {
        Margins rows = *out;
        zone.margins(*points, block, asked, rows);
    });
}
