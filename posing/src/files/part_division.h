// What of a handles or mapping file says how a model is divided: "pinned" and "parts".
#pragma once

#include "limber/internal/strict_json.h"
#include "limber/posing/handles_file.h"

namespace limber::internal {

PartDivision read_division(const JsonObject& file);

}  // namespace limber::internal
