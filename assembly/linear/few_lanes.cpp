// Problems (22) and (21) of one or two postures: lanes that nobody needs
// cost time, and what two lanes touch fits into the fastest cache.
#define FEW_LANES
#include "cpp/assembled.h"
