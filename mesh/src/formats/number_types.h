/// Types of numbers in files, by the names that VTK gives them.
#pragma once

#include <cstdint>
#include <string>

#include "formats/file_scanner.h"

namespace limber::internal {

/// Calls use(T{}) with the type of that name, in small letters.
template <class F>
void with_number_type(const std::string& type, const FileScanner& in, F&& use) {
  if (type == "float")
    use(float{});
  else if (type == "double")
    use(double{});
  else if (type == "char")
    use(std::int8_t{});
  else if (type == "unsigned_char")
    use(std::uint8_t{});
  else if (type == "short")
    use(std::int16_t{});
  else if (type == "unsigned_short")
    use(std::uint16_t{});
  else if (type == "int" || type == "vtkidtype")
    use(std::int32_t{});  // VTK writes its ids as 32 bits
  else if (type == "unsigned_int")
    use(std::uint32_t{});
  else if (type == "long" || type == "vtktypeint64")
    use(std::int64_t{});
  else if (type == "unsigned_long" || type == "vtktypeuint64")
    use(std::uint64_t{});
  else
    in.fail("seen data type " + shown(type) + ", expected one of numbers, such as double or int");
}

}  // namespace limber::internal
