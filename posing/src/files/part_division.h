// Part of a handles or mapping file that divides a model: "pinned" and "parts".
#pragma once

#include "limber/internal/strict_json.h"
#include "limber/posing/handles_file.h"

namespace limber::internal {

PartDivision read_division(const JsonObject& file);

}  // namespace limber::internal
