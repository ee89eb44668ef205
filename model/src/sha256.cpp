#include "limber/model/sha256.h"

#include <sha2.h>

#include <array>
#include <cstdint>

namespace limber {

struct Sha256::Impl {
  SHA2_CTX context;
};

Sha256::Sha256() : impl_(std::make_unique<Impl>()) { SHA256Init(&impl_->context); }
Sha256::~Sha256() = default;

void Sha256::update(std::string_view bytes) {
  SHA256Update(&impl_->context, reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
}

std::string Sha256::hex() {
  std::array<char, SHA256_DIGEST_STRING_LENGTH> digits{};
  SHA256End(&impl_->context, digits.data());
  return digits.data();
}

std::string sha256_hex(std::string_view bytes) {
  Sha256 hash;
  hash.update(bytes);
  return hash.hex();
}

}  // namespace limber
