// Makes fTetWild's meshes reproducible.  fTetWild inserts triangles in a random order;
// it seeds its generator from std::random_device.  This library replaces that function.
// It must be loaded before fTetWild, with its symbols visible to all libraries.  The
// function then always returns the same number.
#include <random>

#define EXPORTED __attribute__((visibility("default")))

EXPORTED std::random_device::result_type std::random_device::_M_getval() {
    return 5489;  // the default seed of the C++ standard's std::mt19937
}
