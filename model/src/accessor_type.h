/// @file accessor_type.h
/// Component types of glTF accessors (glTF 2.0, section 3.6.2.2). Private to the model module.
#pragma once

namespace limber::internal {

inline constexpr int kFloat = 5126, kUint32 = 5125, kUint8 = 5121;

}  // namespace limber::internal
