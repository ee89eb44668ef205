#include "limber/collision/narrow_phase.h"
