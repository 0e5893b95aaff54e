// Cone programmes, one in each lane, and the linear systems of their solvers:
//
//     minimise  |G u + h|^2 / 2 - d.u   subject to  H u = e,  |u_k| <= 1, each cone k
#pragma once

#include "real.h"

namespace LANE_SPACE {

// The cones, sorted by their numbers of columns: first discs of two columns, then
// intervals of one, then balls of more.
struct Cones {
    int discs = 0, intervals = 0, count = 0, nu = 0;
    Array<int> balls;       // number of columns of each ball
    Array<int64_t> column;  // (nu,) index of each column in the robot's order

    Cones(const int64_t *starts, int cones) : count(cones), nu(int(starts[cones])) {
        const auto add = [&](int c) {
            for (int64_t i = starts[c]; i < starts[c + 1]; ++i) column.push_back(i);
        };
        for (int c = 0; c < cones; ++c)
            if (starts[c + 1] - starts[c] == 2) ++discs, add(c);
        for (int c = 0; c < cones; ++c)
            if (starts[c + 1] - starts[c] == 1) ++intervals, add(c);
        for (int c = 0; c < cones; ++c)
            if (const int size = int(starts[c + 1] - starts[c]); size > 2)
                balls.push_back(size), add(c);
    }

    // Cones of given numbers; `balls` contains the number of columns of each ball.
    Cones(int discs, int intervals, const Array<int> &balls)
        : discs(discs), intervals(intervals), count(discs + intervals + int(balls.size())),
          nu(std::accumulate(balls.begin(), balls.end(), 2 * discs + intervals)),
          balls(balls) {}

    // Call visit(columns, cone, first column) for every cone.
    template <typename Visit> void each(Visit visit) const {
        int c = 0, at = 0;
        for (; c < discs; ++c, at += 2) visit(Size<2>{}, c, at);
        for (; c < discs + intervals; ++c, ++at) visit(Size<1>{}, c, at);
        for (int size : balls) visit(Size<0>{size}, c++, at), at += size;
    }
    template <int width> struct Size {  // a ball if the width is 0
        static constexpr bool ball = width == 0;
        int columns = width;
        constexpr operator int() const { return ball ? columns : width; }
    };
};

// A problem in each lane, and its solution.
struct Programme {
    const Cones &cones;
    int r, p;     // numbers of rows of G and of H
    Table M;      // (r + p, nu) rows of G, then of H
    Row h, d, e;  // (r,), (nu,), (p,)
    Row u, y;     // (nu,), (r + p,) solution
    bool loaded = false;  // if not, d is zero
    Programme(const Cones &cones, int rows)
        : cones(cones), r(rows), p(0), M(rows, cones.nu), h(rows), d(cones.nu), e(rows),
          u(cones.nu), y(rows) {}
};

// Symmetric systems S x = right.  The lower triangle of S is factored as L D L^T,
// without square roots.
class System {
public:
    Table S;
    explicit System(int rows) : S(rows, rows), size(rows) {}

    // Factor S.  Return the lanes in which every pivot is a number.  If `replace`, a
    // pivot lost to rounding is replaced by 1e128, so that its unknown becomes nearly
    // zero; otherwise the lane fails.  The diagonal is overwritten with D^-1.
    Whole factor(int m, bool replace) {
        Whole good = whole(-1);
        for (int j = 0; j < m; ++j) size[j] = S[j][j];
        for (int j = 0; j < m; ++j) {
            const Real pivot = S[j][j];
            const Whole clear = pivot > (replace ? 1e-15 * size[j] : Real{});
            S[j][j] = clear ? 1.0 / pivot : real(1e-128);
            good &= replace ? clear | ((pivot == pivot) & (size[j] >= 0.0)) : clear;
            for (int i = j + 1; i < m; ++i) {
                const Real entry = S[i][j], weight = entry * S[j][j];
                for (int l = j + 1; l < i; ++l) S[i][l] -= weight * S[j][l];
                S[i][i] -= weight * entry;
                S[j][i] = entry, S[i][j] = weight;  // D L^T above the diagonal, L below
            }
        }
        return good;
    }

    void solve(int m, Real *x) {
        for (int j = 0; j < m; ++j) {
            x[j] *= S[j][j];
            for (int i = j + 1; i < m; ++i) x[i] -= S[j][i] * x[j];
        }
        for (int j = m - 1; j >= 0; --j)
            for (int i = 0; i < j; ++i) x[i] -= S[j][i] * x[j];
    }

private:
    Row size;
};

}  // namespace LANE_SPACE
