// One problem where others stand side by side: numbers that behave like vectors of one
// lane, for a device, each of whose threads solves a problem of its own.
#pragma once

#include "standard.h"

constexpr int LANES = 1;

// A whole number, or a mask: 0 or -1.
struct Whole {
    int64_t value = 0;
    Whole() = default;
    Whole(int64_t value) : value(value) {}
    explicit operator bool() const { return value != 0; }
    int64_t &operator[](int) { return value; }
    int64_t operator[](int) const { return value; }
    Whole operator~() const { return ~value; }
    friend Whole operator&(Whole a, Whole b) { return a.value & b.value; }
    friend Whole operator|(Whole a, Whole b) { return a.value | b.value; }
    friend Whole operator+(Whole a, Whole b) { return a.value + b.value; }
    friend Whole operator<(Whole a, Whole b) { return -int64_t(a.value < b.value); }
    friend Whole operator<=(Whole a, Whole b) { return -int64_t(a.value <= b.value); }
    friend Whole operator>(Whole a, Whole b) { return b < a; }
    friend Whole operator>=(Whole a, Whole b) { return b <= a; }
    friend Whole operator==(Whole a, Whole b) { return -int64_t(a.value == b.value); }
    Whole &operator&=(Whole other) { return value &= other.value, *this; }
    Whole &operator|=(Whole other) { return value |= other.value, *this; }
    Whole &operator-=(Whole other) { return value -= other.value, *this; }
};

struct Real {
    double value = 0.0;
    Real() = default;
    Real(double value) : value(value) {}
    double &operator[](int) { return value; }
    double operator[](int) const { return value; }
    Real operator-() const { return -value; }
    friend Real operator+(Real a, Real b) { return a.value + b.value; }
    friend Real operator-(Real a, Real b) { return a.value - b.value; }
    friend Real operator*(Real a, Real b) { return a.value * b.value; }
    friend Real operator/(Real a, Real b) { return a.value / b.value; }
    friend Whole operator<(Real a, Real b) { return -int64_t(a.value < b.value); }
    friend Whole operator<=(Real a, Real b) { return -int64_t(a.value <= b.value); }
    friend Whole operator>(Real a, Real b) { return b < a; }
    friend Whole operator>=(Real a, Real b) { return b <= a; }
    friend Whole operator==(Real a, Real b) { return -int64_t(a.value == b.value); }
    friend Whole operator!=(Real a, Real b) { return -int64_t(a.value != b.value); }
    Real &operator+=(Real other) { return value += other.value, *this; }
    Real &operator-=(Real other) { return value -= other.value, *this; }
    Real &operator*=(Real other) { return value *= other.value, *this; }
    Real &operator/=(Real other) { return value /= other.value, *this; }
};

inline Real root(Real x) { return sqrt(x.value); }
inline Real once(Real x) { return x; }
