/// @file limber/view/page_file.h
/// A scene and all its files as one HTML page (limber-view): engine, drawing and assets inside.
///
/// The page asks nothing of a network and runs nothing but its own script, whose hash its Content-Security-Policy
/// names. Contents of files are data: bytes as base64, texts as JSON in which no markup can stand.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "limber/articulation/joints_file.h"
#include "limber/mesh/grouped_surface.h"

namespace limber {

/// A file as the page sees it, below /scene/.
struct PageFile {
  std::string path{};
  std::string bytes{};
};

struct PageContent {
  std::string scene{};  ///< path of the scene's file among these, or of a model to be posed
  std::vector<PageFile> files{};
  std::string joints{};  ///< of a model to be posed: path of its joints file
};

/// A scene with its assets and the files of its shapes, which get names of our own. Reads and checks all of it. Shapes
/// of modes are rounded to 16 bits, here and below.
/// @throws InputError as read_scene() and load_models()
PageContent page_of_scene(const std::filesystem::path& scene);

/// Which axis of an asset's bodies points up.
enum class UpAxis { kY, kZ };

/// A scene made for an asset: a machine as it was drawn, on the ground where nothing ties it to the world; single
/// bodies side by side, free ones fall on the ground from half their size. @param up none: y for what was baked from
/// glTF (Provenance::input), whose format says so; else z @throws InputError as read_asset()
PageContent page_of_asset(const std::filesystem::path& asset, std::optional<UpAxis> up = {});

/// A model to be posed (limber/view/page_pose.h). @param name shown as the page's title. @param joints_name of the
/// joints file, for messages @throws InputError where they do not go together
PageContent page_of_pose(const GroupedSurface& surface, const JointsFile& joints, const std::string& name,
                         const std::string& joints_name);

/// @param empty the page without a scene, which limber-view has inside. @param compress makes gzip's bytes of others;
/// without it files stay as large as they are
/// @throws InvalidArgument where `empty` has no place for files
std::string page_with(std::string_view empty, const PageContent& content,
                      const std::function<std::string(std::string_view)>& compress = {});

}  // namespace limber
