// Rotation matrices and rotation vectors of several problems in parallel.
//
// A rotation matrix is stored as nine numbers, row after row.
#pragma once

#include "real.h"

namespace LANE_SPACE {

// Compute the rotation vector of a rotation matrix from its quaternion, by way of the
// largest component.  Source: Shepperd (1978), Quaternion from rotation matrix.
inline void rotation_log(const double *R, double *turn) {
    const double trace = R[0] + R[4] + R[8];
    int best = 3;
    double largest = trace;
    for (int i = 0; i < 3; ++i)
        if (R[4 * i] > largest) best = i, largest = R[4 * i];
    double q[4];
    if (best == 3) {
        q[0] = R[7] - R[5];
        q[1] = R[2] - R[6];
        q[2] = R[3] - R[1];
        q[3] = 1.0 + trace;
    } else {
        const int i = best, j = (best + 1) % 3, k = (best + 2) % 3;
        q[i] = 1.0 - trace + 2.0 * R[4 * i];
        q[j] = R[3 * j + i] + R[3 * i + j];
        q[k] = R[3 * k + i] + R[3 * i + k];
        q[3] = R[3 * k + j] - R[3 * j + k];
    }
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    double factor = 0.0;
    // q and -q are the same rotation; the vector of at most half a turn is chosen
    if (sine >= 1e-300)
        factor = std::copysign(2.0 * std::atan2(sine, std::fabs(q[3])) / sine, q[3]);
    for (int k = 0; k < 3; ++k) turn[k] = factor * q[k];
}

// Compute 1 + a S + b S S, where S is the cross-product matrix of v.
inline void turned(const double *v, double a, double b, double *A) {
    const double x = v[0], y = v[1], z = v[2];
    A[0] = 1.0 - b * (y * y + z * z);
    A[4] = 1.0 - b * (x * x + z * z);
    A[8] = 1.0 - b * (x * x + y * y);
    A[1] = b * x * y - a * z, A[3] = b * x * y + a * z;
    A[2] = b * x * z + a * y, A[6] = b * x * z - a * y;
    A[5] = b * y * z - a * x, A[7] = b * y * z + a * x;
}

// Compute the rotation matrix of a rotation vector by Rodrigues' formula.
inline void rotation_exp(const double *v, double *A) {
    const double angle = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double a = 1.0, b = 0.0;
    if (angle >= 1e-8) {
        const double half = std::sin(angle / 2.0) / angle;
        a = std::sin(angle) / angle, b = 2.0 * half * half;
    }
    turned(v, a, b, A);
}

// Compute the derivative of a rotation vector with respect to a small rotation about
// fixed axes.  Source: Chirikjian, Stochastic Models, Information Theory, and Lie
// Groups 2, section 10.7.
inline void inverse_left_jacobian(const double *v, double *A) {
    const double size = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double angle = size > 1e-6 ? size : 1e-6, half = angle / 2.0;
    turned(v, -0.5, (1.0 - half / std::tan(half)) / (angle * angle), A);
}

// Compute the rotation vectors of A B^T.
inline void rotation_between(const Real *A, const Real *B, Real *turn) {
    Real trace = {};
    for (int k = 0; k < 3; ++k) turn[k] = Real{};
    for (int k = 0; k < 3; ++k) {
        const Real p = A[k], q = A[3 + k], r = A[6 + k];
        const Real l = B[k], m = B[3 + k], n = B[6 + k];
        turn[0] += r * m - q * n;
        turn[1] += p * n - r * l;
        turn[2] += q * l - p * m;
        trace += p * l + q * m + r * n;
    }
    // twice the sine of the angle
    const Real sine = root(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    for (int l = 0; l < LANES; ++l) {
        if (trace[l] < 1.0) {  // beyond a quarter turn the sine loses accuracy
            double C[9] = {}, vector[3];
            for (int i = 0; i < 9; ++i)
                for (int k = 0; k < 3; ++k)
                    C[i] += A[i / 3 * 3 + k][l] * B[i % 3 * 3 + k][l];
            rotation_log(C, vector);
            for (int k = 0; k < 3; ++k) turn[k][l] = vector[k];
            continue;
        }
        const double angle = std::atan2(sine[l], trace[l] - 1.0);
        const double factor = sine[l] >= 1e-300 ? angle / sine[l] : 0.0;
        for (int k = 0; k < 3; ++k) turn[k][l] *= factor;
    }
}

// Compute sines and cosines.  A quarter turn, split into three constants, is
// subtracted from the angle as often as it fits (Cody, Waite).  The polynomials are
// those of Moshier's Cephes library.
inline void sine_cosine(Real x, Real *sine, Real *cosine) {
    // 1.5 2^52: a number added to it is rounded to an integer
    constexpr double MAGIC = 6755399441055744.0;
    // [rad] from here on the three constants are not accurate enough
    constexpr double LARGE = 1e5;
    const Real moved = x * 0.63661977236758134308 + MAGIC, quarters = moved - MAGIC;
    Real y = x - quarters * 1.57079632673412561417;
    y -= quarters * 6.07710050630396597660e-11;
    y -= quarters * 2.02226624879595063154e-21;
    const Real z = y * y;
    Real s = z * 1.58962301576546568060e-10 - 2.50507477628578072866e-8;
    s = s * z + 2.75573136213857245213e-6;
    s = s * z - 1.98412698295895385996e-4;
    s = s * z + 8.33333333332211858878e-3;
    s = s * z - 1.66666666666666307295e-1;
    s = y + y * z * s;
    Real c = 2.08757008419747316778e-9 - z * 1.13585365213876817300e-11;
    c = c * z - 2.75573141792967388112e-7;
    c = c * z + 2.48015872888517045348e-5;
    c = c * z - 1.38888888888730564116e-3;
    c = c * z + 4.16666666666665929218e-2;
    c = 1.0 - 0.5 * z + z * z * c;
    const Whole number = (Whole)moved;  // the last two bits count quarter turns
    const Whole odd = (number & 1) != 0;
    const Real a = odd ? c : s, b = odd ? s : c;
    *sine = (number & 2) != 0 ? -a : a;
    *cosine = ((number + 1) & 2) != 0 ? -b : b;
    for (int l = 0; l < LANES; ++l)
        if (!(std::fabs(x[l]) < LARGE)) {
            (*sine)[l] = std::sin(x[l]);
            (*cosine)[l] = std::cos(x[l]);
        }
}

}  // namespace LANE_SPACE
