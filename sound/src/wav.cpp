#include "limber/sound/wav.h"

#include <bit>
#include <cstdint>
#include <cstring>

#include "limber/core/error.h"

namespace limber {
namespace {

static_assert(std::endian::native == std::endian::little, "a WAV file is little-endian");

template <class T>
void append_number(std::string& bytes, T number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

}  // namespace

std::string wav_bytes(std::span<const float> interleaved, int channels, int sample_rate) {
  constexpr std::uint32_t kHeader = 50;  // of the RIFF chunk, beside the samples
  if (channels < 1 || channels > 16 || interleaved.size() % static_cast<std::size_t>(channels) != 0)
    throw InvalidArgument("wav_bytes: " + std::to_string(interleaved.size()) + " samples in " +
                          std::to_string(channels) + " channels, expected 1 to 16 channels of as many each");
  if (sample_rate < 1 || sample_rate > 384000)
    throw InvalidArgument("wav_bytes: sample_rate is " + std::to_string(sample_rate) + ", expected 1 to 384000");
  if (interleaved.size() > (0xFFFFFFFFu - kHeader) / sizeof(float))
    throw InvalidArgument("wav_bytes: " + std::to_string(interleaved.size()) + " samples are more than a file holds");
  const auto size = static_cast<std::uint32_t>(interleaved.size() * sizeof(float));
  const auto frame = static_cast<std::uint16_t>(sizeof(float) * static_cast<std::size_t>(channels));
  std::string bytes = "RIFF";
  append_number(bytes, kHeader + size);
  bytes += "WAVEfmt ";
  append_number(bytes, std::uint32_t{18});
  append_number(bytes, std::uint16_t{3});  // IEEE floating point
  append_number(bytes, static_cast<std::uint16_t>(channels));
  append_number(bytes, static_cast<std::uint32_t>(sample_rate));
  append_number(bytes, static_cast<std::uint32_t>(sample_rate) * frame);
  append_number(bytes, frame);
  append_number(bytes, std::uint16_t{32});
  append_number(bytes, std::uint16_t{0});
  bytes += "fact";
  append_number(bytes, std::uint32_t{4});
  append_number(bytes, static_cast<std::uint32_t>(interleaved.size() / static_cast<std::size_t>(channels)));
  bytes += "data";
  append_number(bytes, size);
  bytes.append(reinterpret_cast<const char*>(interleaved.data()), size);
  return bytes;
}

}  // namespace limber
