// Effects of loads on a robot without clearances and errors, at several postures in
// parallel.  Problem (22) under loads is
//
//     minimise  |y|^2 / 2 - f.y - c.u - g.q   subject to  A_q q + A_u u + A_y y = -known,
//
// with loads f on the springs, c on the clearances and g on the free motions.  The
// closures carry wrenches w that balance the free motions, A_q^T w = -g.  Those with
// the least energy of the springs make the deformations t = f + A_y^T w orthogonal to
// the closure columns of the springs.  With y = t + y', where t and y' are orthogonal,
// the energy and the objective are
//
//     |t|^2 / 2 + |G u + h|^2 / 2   and   |G u + h|^2 / 2 - d.u + constant
//
// with d = c + A_u^T w.  G and h are those of the robot without loads.  d are the
// forces that the loads exert on the clearances.
#pragma once

#include "reduction.h"

namespace LANE_SPACE {

// force on a free motion that counts as zero, as a share of the largest such force
constexpr double STILL_OF_DRIVE = 1e-9;

class Loaded : public Reduction {
public:
    Loaded(const Robot &s, const Points &points)
        : Reduction(s, points), loaded(points.loads), load_strain(loaded ? s.ny : 0),
          closure_wrench(loaded ? m : 0), drive(loaded ? nq : 0),
          clearance_load(loaded ? nu : 0), strain_error(loaded ? 6 * ng : 0),
          clearance_force(loaded ? nu : 0) {
        programme.loaded = loaded;
    }

protected:
    const bool loaded;
    Row load_strain;     // (ny,) t, deformations by the loads alone
    Row closure_wrench;  // (m,) w, wrenches on the closures
    Row drive;           // (nq,) g, forces on the free motions
    Row clearance_load;  // (nu,) c, forces on the clearances, robot's order
    Row strain_error;    // (r,) rounding error of t along the springs' closure columns
    Real stored;         // |t|^2 / 2, energy of the loads alone

    Whole balance(const Points &points, const Block &block, int rank, int r);
    Whole bring_into_balance(const Points &points, const Block &block, int rank, int r);
    Real along(const Real *column, const Real *wrench) const;
    Row on_patterns(const Row &closing) const;

private:
    std::vector<double> acting;  // loads of all lanes, if equal; otherwise empty
    int64_t balanced = -1;       // value of `changes` at the last balance
    Row clearance_force;         // (nu,) d, solver's order
    Whole driven;

    Row group_deformation();
};

// Return the work of a wrench on a unit motion along a column.
inline Real Loaded::along(const Real *column, const Real *wrench) const {
    Real total = {};
    for (int a = 0; a < 6; ++a) total += column[a] * wrench[a];
    return total;
}

// Return the wrenches (6 np,) that the wrenches `closing` on the closures exert on
// frames of each pattern.
inline Row Loaded::on_patterns(const Row &closing) const {
    Row on(6 * np);
    for (int g = 0; g < np; ++g) part(closing.data(), g, &on[6 * g]);
    return on;
}

// Return t in the six equivalent springs of each group.
inline Row Loaded::group_deformation() {
    Row deformation(6 * ng);
    Triangle rows(6, widest);
    for (int g = 0; g < ng; ++g) {
        const int count = spring_group(g, rows), first = int(s.groups[g]);
        triangulate(rows, 6, count, Real{}, Real{}, -1.0, count);
        Row strains(count);
        std::copy(
            &load_strain[first], &load_strain[first] + (s.groups[g + 1] - first),
            strains.begin());
        turn_back(rows, 6, count, strains.data());
        std::copy(strains.begin(), strains.begin() + 6, &deformation[6 * g]);
    }
    return deformation;
}

// Compute the deformations of the springs, the wrenches on the closures and the forces
// on the clearances for the robot without clearances and errors under its loads.
// Return the lanes where the loads move a free motion that no spring resists.
inline Whole Loaded::balance(
    const Points &points, const Block &block, int rank, int r) {
    const auto load = [&](int64_t half, int64_t j, int64_t axis) {
        return block.read(
            points.loads, points.loads_per_point * 12 * n, 6 * (n * half + j) + axis);
    };
    Row spring_load(s.ny);
    Real most = {};
    for (int c = 0; c < nq; ++c) {
        drive[c] = load(1, s.free_frame[c], s.free_axis[c]);
        if (const double lead = s.free_lead[c])
            drive[c] += lead * load(1, s.free_frame[c], 5);
        most = larger(magnitude(drive[c]), most);
    }
    const Whole loose =
        balance_free_motions(rank, drive, STILL_OF_DRIVE * most, closure_wrench);
    for (int c = 0; c < s.ny; ++c)
        for (int axis = 0; axis < 6; ++axis)
            if (const double weight = s.springs[6 * c + axis])
                spring_load[c] += weight * load(s.of_joint[c], s.spring_frame[c], axis);
    const auto deform = [&] {
        const Row on = on_patterns(closure_wrench);
        for (int c = 0; c < s.ny; ++c)
            load_strain[c] =
                spring_load[c] +
                along(elastic[c], &on[6 * s.pattern_of[s.spring_frame[c]]]);
        return on;
    };
    deform();
    Row deformation = group_deformation();
    minimise_spring_energy(r, deformation, closure_wrench);
    const Row on = deform();
    stored = 0.5 * inner(load_strain.data(), load_strain.data(), int(s.ny));
    strain_error = group_deformation();
    turn_back(springs, r, 6 * ng, strain_error.data());
    for (int c = 0; c < nu; ++c) {
        const int k = int(cones.column[c]);
        const int64_t j = s.cone_frame[k];
        clearance_load[k] = s.cone_size[k] * load(1, j, s.cone_axis[k]);
        clearance_force[c] = clearance_load[k] + enters(k, &on[6 * s.pattern_of[j]]);
    }
    return loose;
}

// Do the same, or use the stored result if neither the posture nor the loads of any
// lane have changed.
inline Whole Loaded::bring_into_balance(
    const Points &points, const Block &block, int rank, int r) {
    const size_t count = 12 * size_t(n);
    const auto of = [&](int l) {
        return points.loads + points.loads_per_point * block.point[l] * count;
    };
    const double *first = of(0);
    const bool each = points.loads_per_point;
    bool alike = !posture.empty();
    for (int l = 1; alike && each && l < LANES; ++l)
        alike = std::equal(first, first + count, of(l));
    const bool known = alike && balanced == changes && acting.size() == count &&
                       (!each || std::equal(first, first + count, acting.data()));
    if (!known) {
        driven = balance(points, block, rank, r);
        acting.assign(first, first + (alike ? count : 0));
        balanced = changes;
    }
    std::copy(clearance_force.begin(), clearance_force.end(), programme.d.begin());
    return driven;
}

}  // namespace LANE_SPACE
