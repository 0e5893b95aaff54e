// What of the standard library is used; a device's compiler comes without one.
#pragma once

#ifndef __CUDACC_RTC__
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numeric>
#include <utility>
#include <vector>
#else

typedef long long int64_t;
#define INFINITY __longlong_as_double(0x7ff0000000000000)
#define NAN __longlong_as_double(0x7ff8000000000000)

[[noreturn]] inline void abort() {
    __trap();
    while (true) {}
}

namespace std {
template <typename T> const T &max(const T &a, const T &b) { return a < b ? b : a; }
template <typename T> const T &min(const T &a, const T &b) { return b < a ? b : a; }
template <typename T> void swap(T &a, T &b) {
    const T kept = a;
    a = b, b = kept;
}
template <typename It, typename T> void fill(It from, It to, const T &value) {
    for (; from != to; ++from) *from = value;
}
template <typename In, typename Out> void copy(In from, In to, Out out) {
    for (; from != to; ++from, ++out) *out = *from;
}
template <typename It> It max_element(It from, It to) {
    It most = from;
    for (; from != to; ++from)
        if (*most < *from) most = from;
    return most;
}
template <typename It, typename T> T accumulate(It from, It to, T total) {
    for (; from != to; ++from) total = total + *from;
    return total;
}
// The first element behind the others: all that is asked for here.
template <typename It> void rotate(It from, It second, It to) {
    for (; second != to; ++from, ++second) swap(*from, *second);
}
}  // namespace std
#endif
