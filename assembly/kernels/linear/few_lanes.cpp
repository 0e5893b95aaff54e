// Problems (22) and (21) of one or two postures.
#define FEW_LANES
#include "assembled.h"
