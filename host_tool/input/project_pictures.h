// The pictures that another program's project names. A project may come from anywhere, so by default it cannot make
// nodal read files outside its own folder.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// Where the pictures of a project may be.
enum class PicturePlaces { kBesideProject, kAnywhere };

/// The option that allows kAnywhere, of every command that reads projects.
inline constexpr const char* kPicturesAnywhere = "--pictures-anywhere";

inline constexpr const char* kPicturesAnywhereHelp = "A project may name pictures outside its own folder";

/// The file of `image` as the project `project` names it: relative to the project's folder, or absolute. With
/// kBesideProject it must be in that folder or below it, also after links are followed.
/// Errors: kBadValue, which names project, picture and option.
Result<std::string> project_picture(const std::string& project, const std::string& image, PicturePlaces places);
/// The same for several.
Result<std::vector<std::string>> project_pictures(const std::string& project, const std::vector<std::string>& images,
                                                  PicturePlaces places);

}  // namespace nodal::host
