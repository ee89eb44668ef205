/// @file limber/model/sha256.h
/// SHA-256 (FIPS 180-4), by which an asset knows its input file and its own content.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace limber {

/// A hash fed in pieces.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void update(std::string_view bytes);
  /// 64 lower-case hexadecimal digits. Call once, last.
  std::string hex();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The hash of one piece.
std::string sha256_hex(std::string_view bytes);

}  // namespace limber
