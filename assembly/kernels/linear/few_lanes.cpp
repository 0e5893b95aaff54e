// Problems (22) and (21) at one or two postures.
#define FEW_LANES
#include "assembled.h"
