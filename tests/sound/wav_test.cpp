#include "limber/sound/wav.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <vector>

#include "limber/core/error.h"

namespace limber {
namespace {

template <class T>
T number_at(const std::string& bytes, std::size_t at) {
  T number{};
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

// The layout of RIFF WAVE with a format chunk of 18 bytes, a fact chunk and the data.
TEST(Wav, ChunksTellWhatFollows) {
  const std::vector<float> samples{0.0f, 0.5f, -0.25f, 1.0f, 0.125f, -1.0f};
  const std::string bytes = wav_bytes(samples, 2, 44100);
  EXPECT_EQ(bytes.substr(0, 4), "RIFF");
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 4), bytes.size() - 8);
  EXPECT_EQ(bytes.substr(8, 8), "WAVEfmt ");
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 16), 18u);
  EXPECT_EQ(number_at<std::uint16_t>(bytes, 20), 3u);  // floating point
  EXPECT_EQ(number_at<std::uint16_t>(bytes, 22), 2u);
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 24), 44100u);
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 28), 44100u * 8);
  EXPECT_EQ(number_at<std::uint16_t>(bytes, 32), 8u);
  EXPECT_EQ(number_at<std::uint16_t>(bytes, 34), 32u);
  EXPECT_EQ(bytes.substr(38, 4), "fact");
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 46), 3u);  // per channel
  EXPECT_EQ(bytes.substr(50, 4), "data");
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 54), samples.size() * 4);
  for (std::size_t i = 0; i < samples.size(); ++i) EXPECT_EQ(number_at<float>(bytes, 58 + 4 * i), samples[i]);
  EXPECT_EQ(bytes.size(), 58 + 4 * samples.size());
}

TEST(Wav, RefusesChannelsThatDoNotFit) {
  const std::vector<float> samples(5);
  EXPECT_THROW(wav_bytes(samples, 2, 44100), InvalidArgument);
  EXPECT_THROW(wav_bytes(samples, 0, 44100), InvalidArgument);
  EXPECT_THROW(wav_bytes(samples, 5, 0), InvalidArgument);
}

}  // namespace
}  // namespace limber
