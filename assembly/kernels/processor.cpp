// Level of the x86-64 instruction set that the processor has and that the operating
// system allows.  Source: x86-64 psABI, table 3.1.
#include <cpuid.h>
#include <nanobind/nanobind.h>

#include <cstdint>

namespace {

struct Registers {
    unsigned a = 0, b = 0, c = 0, d = 0;
};

Registers cpuid(unsigned leaf) {
    Registers r;
    __get_cpuid_count(leaf, 0, &r.a, &r.b, &r.c, &r.d);
    return r;
}

bool all(unsigned found, unsigned wanted) { return (found & wanted) == wanted; }

// Bits of the register sets that the operating system saves: 1 for SSE, 2 for AVX, 5 to
// 7 for AVX-512.
unsigned saved() {
    unsigned low = 0, high = 0;
    asm volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

int level() {
    const Registers one = cpuid(1), seven = cpuid(7), more = cpuid(0x80000001);
    // SSE3, SSSE3, CMPXCHG16B, SSE4.1, SSE4.2, POPCNT; LAHF
    const unsigned second = 1u << 0 | 1u << 9 | 1u << 13 | 1u << 19 | 1u << 20 | 1u << 23;
    if (!all(one.c, second) || !all(more.c, 1u)) return 1;
    // FMA, MOVBE, OSXSAVE, AVX, F16C; BMI1, AVX2, BMI2; LZCNT
    const unsigned third = 1u << 12 | 1u << 22 | 1u << 27 | 1u << 28 | 1u << 29;
    if (!all(one.c, third) || !all(seven.b, 1u << 3 | 1u << 5 | 1u << 8)) return 2;
    if (!all(more.c, 1u << 5) || !all(saved(), 0x6)) return 2;
    // AVX-512 F, DQ, CD, BW, VL
    const unsigned fourth = 1u << 16 | 1u << 17 | 1u << 28 | 1u << 30 | 1u << 31;
    return all(seven.b, fourth) && all(saved(), 0xe6) ? 4 : 3;
}

}  // namespace

NB_MODULE(_processor, m) { m.def("level", &level); }
