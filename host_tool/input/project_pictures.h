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

struct ProjectPicture {
  std::string file;
  bool moved = false;  ///< not where the project says, but of this name beside it
};

/// The file of `image` as the project `project` names it: relative to the project's folder, or absolute, also as
/// another system writes paths (C:\folder\a.jpg). With kBesideProject it must be in that folder or below it, also after
/// links are followed. A picture that is not there or not allowed is looked for beside the project: below its folder
/// under the last parts of its path, whatever their case.
/// Errors: kBadValue, which names project, picture and option.
Result<ProjectPicture> project_picture(const std::string& project, const std::string& image, PicturePlaces places);

struct FoundPictures {
  std::vector<std::string> files;
  std::vector<std::string> notes;  ///< a whole sentence if some were found beside the project
};

/// The same for several.
Result<FoundPictures> project_pictures(const std::string& project, const std::vector<std::string>& images,
                                       PicturePlaces places);

}  // namespace nodal::host
