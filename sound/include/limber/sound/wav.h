/// @file limber/sound/wav.h
/// Samples as a WAV file.
#pragma once

#include <span>
#include <string>

namespace limber {

/// A RIFF WAVE file of 32-bit floating-point samples (format 3), which every player and editor reads; full scale is 1.
/// @param interleaved [sample][channel]
/// @throws InvalidArgument for channels outside 1 to 16, a length that is no multiple of them, a rate outside 1 to
/// 384,000, and more than 4 GB
std::string wav_bytes(std::span<const float> interleaved, int channels, int sample_rate);

}  // namespace limber
