#include "assimp_scene.h"

#include <assimp/config.h>
#include <assimp/importerdesc.h>

#include <algorithm>
#include <exception>

#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber::internal {

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; }, ' ');
  return text;
}

std::string quoted_path(const std::filesystem::path& path) {
  std::string name = one_line(path.string());
  return name.insert(0, 1, '"') + '"';
}

bool was_read_as(const Assimp::Importer& importer, const char* extension) {
  const int index = importer.GetPropertyInteger("importerIndex", -1);
  const aiImporterDesc* format = index < 0 ? nullptr : importer.GetImporterInfo(static_cast<std::size_t>(index));
  const std::string reads = " " + std::string(format == nullptr ? "" : format->mFileExtensions) + " ";
  return reads.find(" " + std::string(extension) + " ") != reads.npos;
}

ChildLimits limits_for(const std::filesystem::path& path) {
  const std::size_t bytes = read_file(path).size();  // for its clear errors: missing, a directory, unreadable, empty
  constexpr std::size_t kMegabyte = 1 << 20, kCopies = 64;
  ChildLimits limits;
  limits.cpu_seconds += static_cast<int>(bytes / kMegabyte);
  limits.more_bytes += kCopies * bytes;
  return limits;
}

const aiScene& read_scene(Assimp::Importer& importer, const std::filesystem::path& path, unsigned steps) {
  // Without it a file of bones alone would come back as little diamonds around each bone.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  // Coordinates keep the file's axes, in COLLADA as in every other format.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* scene = nullptr;
  const std::string name = quoted_path(path);
  try {
    scene = importer.ReadFile(path.string(), steps);
  } catch (const std::exception& e) {
    throw InputError(name + ": Assimp cannot read it: " + one_line(e.what()));
  }
  if (scene == nullptr || scene->mRootNode == nullptr)
    throw InputError(name + ": Assimp cannot read it: " + one_line(importer.GetErrorString()));
  return *scene;
}

}  // namespace limber::internal
