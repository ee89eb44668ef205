// Work of others' code on others' files, in a process of its own.
#pragma once

#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "limber/core/error.h"
#include "limber/core/types.h"

namespace limber::internal {

/// Numbers and texts one behind the other, as a child hands them to its parent.
class MessageWriter {
 public:
  template <class T>
  requires std::is_arithmetic_v<T>
  void put(T number) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &number, sizeof(T));
    bytes_.append(bytes, sizeof(T));
  }
  void put(std::string_view text) {
    put(text.size());
    bytes_ += text;
  }
  void put(const Vec3& x) {
    for (const double c : x) put(c);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

class MessageReader {
 public:
  explicit MessageReader(std::string bytes) : bytes_(std::move(bytes)) {}
  template <class T>
  T get() {
    T number{};
    std::memcpy(&number, take(sizeof(T)).data(), sizeof(T));
    return number;
  }
  std::string get_text() { return std::string(take(get<std::size_t>())); }
  Vec3 get_vector() {
    Vec3 x;
    for (double& c : x) c = get<double>();
    return x;
  }

 private:
  std::string_view take(std::size_t size) {
    if (size > bytes_.size() - at_) throw InputError("a message from a child process is cut off");
    at_ += size;
    return std::string_view(bytes_).substr(at_ - size, size);
  }
  std::string bytes_;
  std::size_t at_ = 0;
};

/// What a child may use.
struct ChildLimits {
  int cpu_seconds = 10;
  std::size_t more_bytes = std::size_t{1} << 30;  ///< of memory, on top of what this process has
};

/// Runs `work` in a forked process, which prints nothing, and returns what it wrote. What the work throws is thrown
/// here as InputError. @param name of the file, quoted, for messages
/// @throws InputError in one line where the child ends by a signal or at a limit, with which
MessageReader in_child(const std::string& name, const ChildLimits& limits,
                       const std::function<void(MessageWriter&)>& work);

}  // namespace limber::internal
