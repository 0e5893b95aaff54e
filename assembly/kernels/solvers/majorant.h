// A second upper bound for (27).  Outer approximation by planes is slow for a round
// body: all directions are nearly equal, and about 1 / gap planes are needed.  For such
// bodies this bound is exact.  The support function is the minimum, over n, of linear
// terms plus sum_k |w_k|, with w = X^T d - H^T n.  For any s_k > 0,
//
//     |w_k|  <=  |w_k|^2 / (2 s_k)  +  s_k / 2,
//
// with equality where s_k = |w_k|.  The s_k are computed from one direction.  The
// minimum over n is then a quadratic function of d.  It is an upper bound of the
// support function for all directions, with equality for this one.  Its largest value
// on the unit sphere follows from an eigenvalue problem.  If the direction is that of
// the farthest point, this value usually equals the distance of that point; for a disc
// or an ellipsoid it always does.
//
// Sources: Conn, Gould, Toint (2000), Trust-Region Methods, section 7.3, for the
// largest value of a quadratic function on a sphere; Golub, Van Loan, Matrix
// Computations, 4th ed., section 8.5 (Jacobi's method).
#pragma once

#include "cones.h"
#include "polytope.h"

namespace LANE_SPACE {

constexpr double LEAST_SIZE = 1e-9;  // least s_k, as a share of the largest one

// Compute the eigenvalues of a symmetric matrix, and its eigenvectors as columns of V,
// by Jacobi's method.
inline void eigenvectors(const Point *Q, Point &values, Point *V) {
    Point D[3] = {Q[0], Q[1], Q[2]};
    for (int i = 0; i < 3; ++i)
        for (int a = 0; a < 3; ++a) V[i][a] = i == a;
    for (int sweep = 0; sweep < 12; ++sweep) {
        const double off = D[0][1] * D[0][1] + D[0][2] * D[0][2] + D[1][2] * D[1][2];
        if (off <= 1e-34 * (D[0][0] * D[0][0] + D[1][1] * D[1][1] + D[2][2] * D[2][2]))
            break;
        for (int a = 0; a < 2; ++a)
            for (int b = a + 1; b < 3; ++b) {
                if (D[a][b] == 0.0) continue;
                const double theta = (D[b][b] - D[a][a]) / (2.0 * D[a][b]);
                const double sign = theta >= 0.0 ? 1.0 : -1.0;
                const double t = sign / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
                const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
                const auto turned = [&](double &x, double &y) {
                    const double kept = x;
                    x = c * kept - s * y, y = s * kept + c * y;
                };
                for (int i = 0; i < 3; ++i) turned(D[i][a], D[i][b]);
                for (int i = 0; i < 3; ++i) turned(D[a][i], D[b][i]);
                for (int i = 0; i < 3; ++i) turned(V[i][a], V[i][b]);
            }
    }
    for (int i = 0; i < 3; ++i) values[i] = D[i][i];
}

// Return an upper bound of the largest value of d.Q d / 2 + g.d over unit vectors d.
// It exceeds that value by at most the rounding error.
inline double largest_on_sphere(const Point *Q, const Point &g) {
    Point values, along = {}, V[3];
    eigenvectors(Q, values, V);
    for (int i = 0; i < 3; ++i)
        for (int a = 0; a < 3; ++a) along[i] += V[a][i] * g[a];
    const double top = std::max({values[0], values[1], values[2]});
    const double length = std::sqrt(inner(g, g));
    double size = std::max(length, 1e-300);
    for (double value : values) size = std::max(size, std::fabs(value));
    // any multiplier m > top gives the upper bound m / 2 + sum_i g_i^2 / (2 (m - q_i)),
    // with the eigenvalues q_i; the least bound has |g / (m - q)| = 1 or m = top
    const double high = length + 1e-15 * size;
    double shift = 1e-15 * size;
    for (int step = 0; step < 60; ++step) {
        double first = 0.0, second = 0.0;
        for (int i = 0; i < 3; ++i) {
            const double part = along[i] / (top + shift - values[i]);
            first += part * part;
            second += part * part / (top + shift - values[i]);
        }
        first = std::sqrt(first);
        if (!(first > 1.0 + 1e-14)) break;
        // Newton's method on 1 / |g / (m - q)|, which is concave: from the left of the
        // root all iterates remain on the left
        shift = std::min(high, shift + first * first / second * (first - 1.0));
    }
    const double m = top + shift;
    double total = m / 2.0;
    for (int i = 0; i < 3; ++i) total += along[i] * along[i] / (2.0 * (m - values[i]));
    return total;
}

// Three components of bodies {centre + X (v - start) : |v_k| <= 1, H (v - start) = 0}
// of screws, one body in each lane.  Rows and cones that a lane does not have are zero.
struct Projection {
    const Cones &cones;
    int p;
    Table X, H;           // (3, nv), (p, nv) orthonormal rows
    Real centre[3];
    Row start, right;     // (nv,) within the cones; (p,) H start
    std::vector<Whole> present;  // cones that a lane has
    Whole rows;           // number of rows in each lane
    Projection(const Cones &cones, int p)
        : cones(cones), p(p), X(3, cones.nu), H(p, cones.nu), start(cones.nu), right(p),
          present(cones.count) {}
};

// Upper bounds of |centre + X (v - start)| from the gradient w = X^T d - H^T n at a
// direction d.  A bound is infinite where w is zero or where rounding errors dominate.
class Majorant {
public:
    Majorant(int nv, int p)
        : scaled(1, nv), S(p, p), right(4, p), A(3, nv), sizes(nv), fixed(nv) {}

    void bound(const Projection &body, const Row &w, Whole requested, double *out) {
        const int nv = body.cones.nu;
        Real largest = {}, total = {};
        body.cones.each([&](auto of, int, int at) {
            sizes[at] = root(inner(&w[at], &w[at], of));
            largest = larger(sizes[at], largest);
        });
        requested &= largest > 1e-150;  // a zero gradient gives no bound
        body.cones.each([&](auto of, int c, int at) {
            const Real size = larger(sizes[at], LEAST_SIZE * largest);
            total += body.present[c] ? size : Real{};
            for (int j = at; j < at + of; ++j) sizes[j] = 1.0 / size;
        });
        std::fill(fixed.begin(), fixed.end(), Real{});
        for (int a = 0; a < 3; ++a) std::copy(body.X[a], body.X[a] + nv, A[a]);
        requested &= follow_rows(body);
        // n minimises sum_j w_j^2 / (2 s_j) - w.start; then H (w / s - start) = 0, and
        // w is a linear function A d + fixed of d
        Real Q[3][3] = {}, linear[3], constant = 0.5 * total;
        for (int a = 0; a < 3; ++a) linear[a] = body.centre[a];
        for (int j = 0; j < nv; ++j) {
            const Real slope = fixed[j] * sizes[j] - body.start[j];
            constant += fixed[j] * (0.5 * fixed[j] * sizes[j] - body.start[j]);
            for (int a = 0; a < 3; ++a) {
                linear[a] += A[a][j] * slope;
                for (int b = 0; b <= a; ++b) Q[a][b] += A[a][j] * A[b][j] * sizes[j];
            }
        }
        for (int l = 0; l < LANES; ++l) {
            out[l] = INFINITY;
            if (!requested[l]) continue;
            Point quadratic[3], slope;
            for (int a = 0; a < 3; ++a) {
                slope[a] = linear[a][l];
                for (int b = 0; b < 3; ++b)
                    quadratic[a][b] = a < b ? Q[b][a][l] : Q[a][b][l];
            }
            out[l] = constant[l] + largest_on_sphere(quadratic, slope);
        }
    }

private:
    Table scaled, S, right, A;
    Row sizes, fixed;  // 1 / s_j; terms of w that do not depend on d

    // Subtract the terms of the minimising n from A and `fixed`.  Return the lanes in
    // which the linear system was solved.
    Whole follow_rows(const Projection &body) {
        const int p = body.p, nv = body.cones.nu;
        Whole good = whole(-1);
        for (int i = 0; i < p; ++i) {
            for (int j = 0; j < nv; ++j) scaled[0][j] = body.H[i][j] * sizes[j];
            products<1>(scaled.rows(), body.H.rows(), i + 1, nv, S.rows() + i);
            for (int a = 0; a < 3; ++a)
                right[a][i] = inner(scaled[0], body.X[a], nv);
            right[3][i] = body.right[i];
        }
        for (int i = 0; i < p; ++i) {
            for (int l = 0; l < i; ++l)
                S[i][l] = (S[i][l] - inner(S[i], S[l], l)) * S[l][l];
            const Real pivot = S[i][i] - inner(S[i], S[i], i);
            const Whole present = body.rows > i;
            good &= ~present | (pivot > 0.0);
            // the diagonal is replaced by its inverse; rows that a lane does not have
            // stay zero
            S[i][i] = present ? 1.0 / root(pivot) : real(1.0);
        }
        for (int a = 0; a < 4; ++a) {
            Real *x = right[a];
            for (int i = 0; i < p; ++i) x[i] = (x[i] - inner(S[i], x, i)) * S[i][i];
            for (int i = p - 1; i >= 0; --i) {
                for (int j = i + 1; j < p; ++j) x[i] -= S[j][i] * x[j];
                x[i] *= S[i][i];
            }
            if (a < 3)
                for (int i = 0; i < p; ++i) x[i] = -x[i];
            combine(body.H.rows(), p, x, nv, a < 3 ? A[a] : fixed.data());
        }
        return good;
    }
};

}  // namespace LANE_SPACE
