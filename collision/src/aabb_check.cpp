#include "limber/collision/aabb.h"
