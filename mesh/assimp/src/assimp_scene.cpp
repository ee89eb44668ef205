#include "assimp_scene.h"

#include <assimp/config.h>

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

const aiScene& read_scene(Assimp::Importer& importer, const std::filesystem::path& path, unsigned steps) {
  read_file(path);  // for its clear errors: missing, a directory, unreadable, empty

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
