// Files made elsewhere, cut and changed at random: whatever the format, reading ends soon, with a mesh or one line.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <random>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;

constexpr const char* kModels = "/usr/share/assimp/models";  // Debian: assimp-testmodels
constexpr double kMostSeconds = 10.0, kMostKilobytes = 1e6;

/// Models of up to 200 kB, but for pictures, texts and buffers.
std::vector<fs::path> models() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(kModels)) {
    std::string extension = entry.path().extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const std::string other = " .jpg .png .txt .tga .bmp .gif .mtl .dds .pdf .bin ";
    if (!entry.is_regular_file() || extension.empty() || other.find(" " + extension + " ") != other.npos) continue;
    if (entry.file_size() > 0 && entry.file_size() < 200'000) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Cut, or one to four bytes changed: digits to digits, others in a bit.
std::string damaged(std::string bytes, std::mt19937& random) {
  if (random() % 2 == 0) {
    bytes.resize(1 + random() % bytes.size());
    return bytes;
  }
  for (auto changes = 1 + random() % 4; changes > 0; --changes) {
    char& c = bytes[random() % bytes.size()];
    if (std::isdigit(static_cast<unsigned char>(c)))
      c = static_cast<char>('0' + random() % 10);
    else
      c = static_cast<char>(c ^ 1 << random() % 8);
  }
  return bytes;
}

double seconds_of_cpu(int who) {
  rusage usage{};
  getrusage(who, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

// `LIMBER_TRIALS` says how many: 20,000 in the campaign.
TEST(DamagedCampaign, NoFileOfAnyFormatEndsTheProgramOrHoldsItUp) {
  if (!fs::exists(kModels)) GTEST_SKIP() << "Debian package assimp-testmodels is not installed";
  const char* asked = std::getenv("LIMBER_TRIALS");
  const int trials = asked == nullptr ? 100 : std::atoi(asked);
  const std::vector<fs::path> files = models();
  ASSERT_GT(files.size(), 100u);
  const Folder folder;
  std::mt19937 random(1);
  int read = 0, refused = 0;
  double worst = 0.0;
  for (int trial = 0; trial < trials; ++trial) {
    const fs::path& file = files[random() % files.size()];
    SCOPED_TRACE(std::to_string(trial) + ": " + file.string());
    const fs::path path = folder.write("damaged" + file.extension().string(), damaged(read_file(file), random));
    const double before = seconds_of_cpu(RUSAGE_SELF) + seconds_of_cpu(RUSAGE_CHILDREN);
    try {
      Warnings warnings;
      read_any_mesh(path, warnings);
      ++read;
    } catch (const InputError& e) {  // anything else fails the test by itself
      ++refused;
      EXPECT_EQ(std::string(e.what()).find_first_of("\n\r"), std::string::npos) << e.what();
    }
    const double seconds = seconds_of_cpu(RUSAGE_SELF) + seconds_of_cpu(RUSAGE_CHILDREN) - before;
    EXPECT_LT(seconds, kMostSeconds + 1.0);  // the limit of the child, and what it takes to end it
    worst = std::max(worst, seconds);
  }
  rusage own{};
  getrusage(RUSAGE_SELF, &own);
  EXPECT_LT(static_cast<double>(own.ru_maxrss), kMostKilobytes);
  RecordProperty("read", read);
  RecordProperty("refused", refused);
  RecordProperty("worst_seconds", std::to_string(worst));
}

}  // namespace
}  // namespace limber
