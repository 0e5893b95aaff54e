// Makes fTetWild's meshes reproducible.  It shuffles what it inserts by a generator that
// it seeds from std::random_device; loaded before it, for all libraries to see, this
// returns the same number always.
#include <random>

#define EXPORTED __attribute__((visibility("default")))

EXPORTED std::random_device::result_type std::random_device::_M_getval() {
    return 5489;  // the standard generator's own default
}
